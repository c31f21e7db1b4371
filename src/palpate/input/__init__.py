"""The input: recordings, their channels, the tool on the sensor, and the contact made from them."""

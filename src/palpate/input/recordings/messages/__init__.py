"""Recordings of messages: ROS 1 and ROS 2 bags, and MCAP.

The reader of a container passes blocks of raw messages to a :class:`topic.Topic`, which converts
them to channels. It parses the first message with its definition, which gives a
:class:`layout.Layout`, and reads all messages with that layout as arrays.
"""

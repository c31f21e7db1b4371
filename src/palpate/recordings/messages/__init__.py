"""Recordings of messages: bags of ROS 1 and ROS 2, and MCAP.

A reader of a container hands blocks of raw messages to a :class:`topic.Topic`, which turns them
into channels: the first message of a topic is walked by its definition, and gives a
:class:`layout.Layout`; all messages of that layout are then read as arrays.
"""

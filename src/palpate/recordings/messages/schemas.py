"""How the messages of an MCAP channel are read: by its schema and the encoding of its messages."""

from functools import partial

from palpate.recordings.formats import Request
from palpate.recordings.messages.fields import UndecodableError
from palpate.recordings.messages.topic import BinaryTopic, Topic


def topic_of(
    message_encoding: str, schema_encoding: str, type_name: str, schema: bytes, request: Request
) -> Topic:
    """Return a topic that reads messages of this kind.

    Raises
    ------
    UndecodableError
        They cannot be read.
    """
    if message_encoding == "json":
        from palpate.recordings.messages.json_text import JsonTopic

        return JsonTopic(request)
    if message_encoding == "protobuf" and schema_encoding == "protobuf":
        from palpate.recordings.messages.protobuf import walk_of

        return BinaryTopic(walk_of(type_name, schema), request)
    if message_encoding not in ("cdr", "ros1"):
        raise UndecodableError(
            f"messages in {message_encoding[:30]!r} are not read, only in CDR, ROS 1, JSON or "
            "protobuf"
        )
    from palpate.recordings.messages.definitions import message_fields
    from palpate.recordings.messages.walking import walk_cdr, walk_ros1

    ros1 = message_encoding == "ros1"
    if schema_encoding not in ("ros1msg", "ros2msg", "ros2idl", "omgidl", ""):
        raise UndecodableError(f"definitions in {schema_encoding[:30]!r} are not read")
    form = "ros1msg" if ros1 else schema_encoding or "ros2msg"
    form = "ros2idl" if form == "omgidl" else form
    fields = message_fields(type_name, form, schema.decode("utf-8", "replace"))
    walk = partial(walk_ros1 if ros1 else walk_cdr, fields=fields)
    return BinaryTopic(walk, request, cdr=not ros1)

"""All topics of a recording, and what is said of them."""

from collections.abc import Callable, Hashable
from pathlib import Path

from palpate.errors import RecordingError
from palpate.recordings.formats import Request
from palpate.recordings.messages.channels import Channels
from palpate.recordings.messages.fields import UndecodableError, normal_name
from palpate.recordings.messages.topic import Topic
from palpate.recordings.recording import Recording, printable

NOT_ASKED = "not asked for"
# Characters of definitions that are parsed, in some 5 s. A robot of 40 types of messages has half.
MOST_DEFINITIONS = 400_000
_MOST_LOSSES = 40  # sentences
# Topics of a file: a large robot has some hundreds.
MOST_TOPICS = 5000


class Collection:
    """Topics, as a reader finds them in a file or in several.

    Parameters
    ----------
    path : Path
        The file or folder.
    request : Request
        What is asked for.
    """

    def __init__(self, path: Path, request: Request) -> None:
        self.source = printable(path)
        self.request = request
        self.losses: list[str] = []
        self.omissions: list[str] = []
        self.notes: dict[str, str] = {}
        self._topics: dict[Hashable, Topic] = {}
        self._types: dict[str, str] = {}
        self._more_losses = 0
        self._defined: set[tuple[str, str]] = set()
        self._left = MOST_DEFINITIONS

    def topic(
        self,
        name: str,
        type_name: str,
        encoding: str,
        make: Callable[[Request], Topic],
        definition: int = 0,
    ) -> Topic:
        """Return the topic that takes the messages of a channel of the file.

        Parameters
        ----------
        name, type_name, encoding : str
            As the file says them; channels that have all three in common are one topic.
        make : callable
            Returns a :class:`Topic`; raises UndecodableError where its messages cannot be read.
        definition : int
            How many characters the definition of its messages has.
        """
        name, type_name = one_line(name), normal_name(one_line(type_name))
        key = name, type_name, encoding
        if key in self._topics:
            return self._topics[key]
        if len(self._topics) >= MOST_TOPICS:
            raise self.error(f"more than {MOST_TOPICS} topics", "check the file")
        if self._types.setdefault(name, type_name) != type_name:
            name = f"{name} ({type_name})"
        topic = Topic(name, type_name, self.request)
        if not self.request.wants(name):
            topic.omitted = NOT_ASKED
        else:
            try:
                self._charge(type_name, encoding, definition)
                topic = make(self.request)
                topic.name, topic.type_name = name, type_name
            except UndecodableError as error:
                topic.omitted = str(error)
        self._topics[key] = topic
        return topic

    def _charge(self, type_name: str, encoding: str, definition: int) -> None:
        """Limit the time that definitions take; the same one takes none again."""
        if (type_name, encoding) not in self._defined:
            self._defined.add((type_name, encoding))
            self._left -= definition
        if self._left < 0:
            raise UndecodableError(
                f"the definitions of all topics are longer than {MOST_DEFINITIONS} characters: "
                "name the topics to read"
            )

    def error(self, what: str, cure: str) -> RecordingError:
        """Return an error that names the file."""
        return RecordingError(f"{self.source}: {what}; {cure}")

    def lost(self, sentence: str) -> None:
        """Say what could not be read; raise RecordingError where nothing may be lost."""
        if self.request.strict:
            raise RecordingError(f"{self.source}: {sentence}")
        if sentence in self.losses:
            return
        if len(self.losses) < _MOST_LOSSES:
            self.losses.append(sentence)
        else:
            self._more_losses += 1

    @property
    def messages(self) -> int:
        """How many messages have been found, read or not."""
        return sum(topic.messages for topic in self._topics.values())

    def recording(self) -> Recording:
        """Return what has been collected.

        Raises
        ------
        RecordingError
            It is nothing; or something was asked for that there is not.
        """
        channels = Channels()
        for topic in self._topics.values():
            self._say(topic)
            channels.add(topic)
        self._say_not_asked()
        self.omissions += channels.omissions
        self.notes |= channels.notes
        if self._more_losses:
            self.losses.append(f"and {self._more_losses} losses more")
        self._check(list(channels.values))
        self.request.report(1.0)
        return Recording(
            channels.values,
            units=channels.units,
            source=self.source,
            notes=self.notes,
            clocks=channels.clocks,
            frames=channels.frames,
            types=channels.types,
            faults=channels.faults,
            losses=tuple(self.losses),
            omissions=tuple(self.omissions),
        )

    def _say(self, topic: Topic) -> None:
        what = f"{topic.name} ({topic.type_name}, {topic.messages} messages)"
        if topic.omitted == NOT_ASKED:
            return
        if topic.undecodable:
            self.lost(
                f"{topic.name}: {topic.undecodable} of {topic.messages} messages could not be "
                f"decoded: {topic.reason}"
            )
        if topic.omitted:
            self.omissions.append(f"{what} was not read: {topic.omitted}")
        elif not topic.messages:
            self.omissions.append(f"{what} is empty")
        elif not topic.found:
            asked = "" if self.request.channels is None else " that were asked for"
            self.omissions.append(f"{what} holds no numbers{asked}")
        if topic.found and topic.skipped:
            self.omissions.append(f"{topic.name}: long lists are not read: {_few(topic.skipped)}")
        if topic.overflow:
            self.omissions.append(
                f"{topic.name}: of more than {len(topic.found)} transforms the first are read"
            )
        dropped = {path for found in topic.found.values() for path in found.rows.dropped}
        if dropped:
            self.omissions.append(
                f"{topic.name}: fields that few messages have are not read: {_few(dropped)}"
            )

    def _say_not_asked(self) -> None:
        names = {topic.name for topic in self._topics.values() if topic.omitted == NOT_ASKED}
        if names:
            self.omissions.append(f"not asked for: {_few(names)}")

    def _check(self, names: list[str]) -> None:
        for wanted in self.request.channels or ():
            if not any(_within(name, wanted) for name in names):
                there = sorted({topic.name for topic in self._topics.values()})
                why = [each for each in self.omissions if each.startswith(f"{wanted} ")]
                reason = f"no numbers are read of {wanted!r}" + "".join(f" ({w})" for w in why[:1])
                raise self.error(reason, f"there are the topics {_few(there)}")
        if not names:
            why = [*self.losses, *self.omissions][:2]
            raise self.error(
                "no topic has numbers that can be read" + "".join(f". {each}" for each in why),
                "record a topic of forces and one of positions",
            )


def one_line(text: str) -> str:
    """Return a name from a file so that it can be shown: one line, printable, not endless."""
    shown = "".join(each if each.isprintable() else "?" for each in text[:200])
    return shown if len(text) <= 200 else shown + "…"


def _within(name: str, wanted: str) -> bool:
    return name == wanted or (name.startswith(wanted) and name[len(wanted)] in "./[")


def _few(names: set[str] | list[str]) -> str:
    shown = sorted(names)
    more = f" and {len(shown) - 10} more" if len(shown) > 10 else ""
    return ", ".join(shown[:10]) + more

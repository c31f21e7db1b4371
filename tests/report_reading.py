"""A page as a browser reads it: its elements, names, references and words."""

import html.parser

VOID = {"meta", "br", "img", "source"}
REFERRING = {"href", "src", "xlink:href"}


class Reading(html.parser.HTMLParser):
    """What is open, which names there are, what is referred to, and the words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.names: list[str] = []
        self.references: set[str] = set()
        self.words = ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)
        self.names += [value for name, value in attributes if name == "id"]
        self.references |= {value for name, value in attributes if name in REFERRING}

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words += data

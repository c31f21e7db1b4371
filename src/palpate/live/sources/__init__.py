"""Where live samples come from: a recording, the laboratory, or a robot on the wire."""

from palpate.live.sources.opening import SOURCES, Kind, SourceOptions, open_source

__all__ = ["SOURCES", "Kind", "SourceOptions", "open_source"]

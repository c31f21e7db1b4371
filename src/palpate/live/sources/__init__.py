"""Where live samples come from: a recording, the laboratory, or a robot on the wire."""

from palpate.live.sources.opening import SOURCES as SOURCES
from palpate.live.sources.opening import Kind as Kind
from palpate.live.sources.opening import SourceOptions as SourceOptions
from palpate.live.sources.opening import open_source as open_source

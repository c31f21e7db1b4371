"""The page that a person watches: a server of its own process, and what a browser makes of it."""

from palpate.live.page.sink import Page as Page

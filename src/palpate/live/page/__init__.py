"""The live page: a server in a process of its own, and the page that a browser shows."""

from palpate.live.page.sink import Page as Page

"""The live page: a server in a separate process, and the page that a browser shows."""

from palpate.live.page.sink import Page as Page

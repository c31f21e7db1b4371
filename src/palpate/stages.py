"""Timing of each stage; the module that does the work logs it."""

import functools
import logging
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

# Without this, Python prints palpate's log to a user who did not configure logging.
logging.getLogger("palpate").addHandler(logging.NullHandler())

Given = ParamSpec("Given")
Result = TypeVar("Result")


@contextmanager
def stage(logger: logging.Logger, words: str) -> Iterator[None]:
    """Log how many seconds the block took."""
    begun = time.perf_counter()
    yield
    logger.info("%s: %.4f s", words, time.perf_counter() - begun)


def log_stage(words: str) -> Callable[[Callable[Given, Result]], Callable[Given, Result]]:
    """Decorate a function so that each call is logged as a stage."""

    def decorate(function: Callable[Given, Result]) -> Callable[Given, Result]:
        logger = logging.getLogger(function.__module__)

        @functools.wraps(function)
        def call(*args: Given.args, **kwargs: Given.kwargs) -> Result:
            with stage(logger, words):
                return function(*args, **kwargs)

        return call

    return decorate

"""The headings under which help shows the options."""

from cyclopts import Group

COMMANDS = Group("Commands", sort_key=0)
WHAT = Group("Options", sort_key=1)
OUTPUT = Group("What is printed and drawn", sort_key=2)
JUDGED = Group("How it is judged", sort_key=3)
READ = Group("What is read", sort_key=4)
PREPARED = Group("How it is prepared", sort_key=5)
LOOP = Group("The loop", sort_key=6)
PAGE = Group("The page", sort_key=7)
KEPT = Group("Options in a file", sort_key=8)
ANY = Group("Any command", sort_key=9)

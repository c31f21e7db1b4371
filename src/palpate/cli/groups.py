"""The headings under which help shows the options."""

from cyclopts import Group

COMMANDS = Group("Commands", sort_key=0)
WHAT = Group("Options", sort_key=1)
OUTPUT = Group("What is printed and drawn", sort_key=2)
GUESSED = Group("The material, as guessed", sort_key=0.5)
MEASURED = Group("The sensor", sort_key=0.6)
PLANNED = Group("The motion", sort_key=0.7)
RUN = Group("Where it runs", sort_key=1.6)
ENGINE = Group("The engine", sort_key=1.4)
RIG = Group("The probe and the sensors", sort_key=1.5)
JUDGED = Group("How it is judged", sort_key=3)
DERIVED = Group("What follows from the law", sort_key=4)
READ = Group("What is read", sort_key=5)
PREPARED = Group("How it is prepared", sort_key=6)
LOOP = Group("The loop", sort_key=7)
PAGE = Group("The page", sort_key=8)
KEPT = Group("Options in a file", sort_key=9)
ANY = Group("Any command", sort_key=10)

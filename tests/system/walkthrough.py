# SPDX-License-Identifier: MIT
"""The walk-through of the manual, "An instrument of your own", as steps that can be done. Its convention stands there
in a comment."""
import re
from typing import NamedTuple

from conftest import ROOT

MANUAL = ROOT / "doc" / "manual.md"
BLOCK = re.compile(r"^<!-- (write|add|run|start)(?: (\S+?))?(, numbers vary)? -->\n```\n(.*?)^```$", re.S | re.M)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


class Step(NamedTuple):
    kind: str  # write, add, run, start
    file: str
    vary: bool
    text: str
    line: int  # of the manual


def steps():
    text = MANUAL.read_text()
    begin = text.index("### An instrument of your own")
    section = text[begin:text.index("\n## ", begin)]
    found = [Step(m[1], m[2] or "", bool(m[3]), m[4], text[:begin + m.start(4)].count("\n") + 1)
             for m in BLOCK.finditer(section)]
    assert len(found) == section.count("\n```\n") / 2, "a block without its comment"
    return found


def put(step, folder):
    with open(folder / step.file, "w" if step.kind == "write" else "a") as f:
        f.write(step.text)


def profiles(folder):
    """All files of the walk-through, whole."""
    for step in steps():
        if step.file:
            put(step, folder)


def commands(step):
    """Each command of a step and the lines that it prints."""
    parts = re.split(r"^\$ (.*)\n", step.text, flags=re.M)
    assert parts[0] == "", f"{MANUAL}:{step.line}: begins with no command"
    return list(zip(parts[1::2], (p.splitlines() for p in parts[2::2])))


def line_pattern(line, vary):
    """A regular expression for one printed line."""
    line = line.rstrip()
    if not vary:
        return ".*".join(map(re.escape, line.split("...")))
    words = [NUMBER.pattern.join(map(re.escape, NUMBER.split(word))).replace(re.escape("..."), ".*")
             for word in line.split()]
    return r"\s+".join(words)


def pattern(lines, vary=False):
    whole = "".join(r"(?:.*\n)*?" if line == "..." else line_pattern(line, vary) + r" *\n" for line in lines)
    return re.compile(whole)

"""A list of what is wrong in the user's files, so that all of it is said at once."""

import difflib

from lib.refusal import Refusal, refusal

MAX_LISTED = 30  # more than a screen of complaints helps nobody


class Mistakes:
    """Collects plain sentences; `stop()` raises one Refusal that lists them all, in the order of the files' lines."""

    def __init__(self):
        self._found = []

    def add(self, what, file=None, surface=None, field=None, line=None):
        """Note one mistake; `line` (1-based) is appended to the sentence."""
        text = str(refusal(what, file, surface, field)) + (f" (line {line})" if line else "")
        if text not in (known for _, known in self._found):
            self._found.append(((str(file), line or 0), text))

    def add_text(self, text):
        """Note a mistake that is already a whole sentence (the text of a Refusal)."""
        self._found.append((("", 0), text))

    def __len__(self):
        return len(self._found)

    def stop(self):
        """Raise Refusal if anything was noted."""
        if not self._found:
            return
        files = list(dict.fromkeys(key[0] for key, _ in self._found))
        ordered = sorted(self._found, key=lambda item: (files.index(item[0][0]), item[0][1]))
        lines = [text for _, text in ordered[:MAX_LISTED]]
        if len(ordered) > MAX_LISTED:
            lines.append(f"... and {len(ordered) - MAX_LISTED} mistakes more")
        raise Refusal("\n".join(lines))


def nearest(word, known):
    """`; did you mean X?` for the known word closest to `word`, else an empty text.

    >>> nearest("tolerence", ["seed", "tolerance"])
    '; did you mean tolerance?'
    >>> nearest("zzz", ["seed"])
    ''
    """
    lower = {str(name).lower(): str(name) for name in known}
    close = difflib.get_close_matches(str(word).lower()[:100], lower, n=1, cutoff=0.6)
    return f"; did you mean {lower[close[0]]}?" if close else ""


def listed(names, most=12):
    """Names as a comma-separated text, cut after `most`.

    >>> listed(["a", "b"])
    'a, b'
    """
    names = [str(name) for name in names]
    return ", ".join(names[:most]) + (f", ... ({len(names)} in all)" if len(names) > most else "")


def shown(value, most=60):
    """A value as the user would write it, cut to `most` characters.

    >>> shown("10 mm"), shown(True), shown(None), shown(2.5)
    ("'10 mm'", 'true', 'nothing', '2.5')
    """
    is_word = value is None or isinstance(value, bool)
    text = {True: "true", False: "false", None: "nothing"}[value] if is_word else repr(value)
    return text if len(text) <= most else text[: most - 3] + "..."

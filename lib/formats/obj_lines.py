"""The lines of a Wavefront OBJ as arrays, without a loop over vertices or faces.

A line is known by its first word.  Numbers of all lines of a kind are cut out of the file and converted at once; a line
that does not fit is looked for, by its number, only when that fails.
"""

import re
import warnings

import numpy as np

CONTINUED = re.compile(rb"\\[ \t]*\r?\n")
_BLANK = np.zeros(256, dtype=bool)
_BLANK[list(b" \t\r\n\v\f")] = True
SLASH, HASH = ord("/"), ord("#")


class Lines:
    """Lines of an OBJ.

    data : its bytes; a line that ends in a backslash goes on in the next one, and has the number of its first
    """

    def __init__(self, data):
        if b"\n" not in data:
            data = data.replace(b"\r", b"\n")
        ends = np.flatnonzero(np.frombuffer(data, dtype=np.uint8) == ord("\n"))
        joined = CONTINUED.sub(lambda found: b" " * len(found[0]), data) if b"\\" in data else data
        if not joined.endswith(b"\n"):
            joined += b"\n"
        self.bytes = np.frombuffer(joined, dtype=np.uint8)
        here = np.flatnonzero(self.bytes == ord("\n"))
        self.stop = here + 1
        self.start = np.concatenate([[0], self.stop[:-1]])
        self.number = np.searchsorted(ends, self.start) + 1
        self._words()

    def _words(self):
        """Where words start, how many each line has, and the first three bytes of its first one."""
        blank = _BLANK[self.bytes]
        begins = ~blank
        begins[1:] &= blank[:-1]
        self.word = np.flatnonzero(begins)
        self.n_words = np.add.reduceat(begins, self.start, dtype=np.int32)
        self.first = np.concatenate([[0], np.cumsum(self.n_words)])[:-1]  # of its words, in self.word
        at = self.word[np.minimum(self.first, max(len(self.word) - 1, 0))] if len(self.word) else self.start * 0
        padded = np.concatenate([self.bytes, np.full(3, 32, dtype=np.uint8)])
        head = [padded[at], padded[at + 1], padded[at + 2]]
        blank_head = [_BLANK[byte] for byte in head]
        self._code = head[0].astype(np.int32) << 16
        self._code |= np.where(blank_head[1], 32, head[1]).astype(np.int32) << 8
        self._code |= np.where(blank_head[1] | blank_head[2], 32, head[2])
        self._code[self.n_words == 0] = 0

    def of(self, word):
        """Indices of the lines that start with a word of at most two letters."""
        code = int.from_bytes(word.encode().ljust(3), "big")
        return np.flatnonzero(self._code == code)

    def others(self, words):
        """(index, text) of the lines that start with a letter and none of `words` (of at most two letters)."""
        codes = [0, *(int.from_bytes(word.encode().ljust(3), "big") for word in words)]
        first = self._code >> 16
        is_other = ~np.isin(self._code, codes) & (first != HASH)
        for index in np.flatnonzero(is_other).tolist():
            yield index, self.text(index)

    def text(self, index):
        """One line as text; UTF-8, or else Latin-1."""
        raw = self.bytes[self.start[index] : self.stop[index]].tobytes()
        try:
            return raw.decode().strip()
        except UnicodeDecodeError:
            return raw.decode("latin-1").strip()

    def without_comments(self, lines):
        """The bytes of some lines, which become blank from a `#` on, and the words that are left of each: `body`
        (bytes), `n_words`.  The first word, which names the kind, is blank too.
        """
        size = self.stop[lines] - self.start[lines]
        is_part = np.zeros(len(self.bytes) + 1, dtype=np.int8)
        np.add.at(is_part, self.start[lines], 1)
        np.add.at(is_part, self.stop[lines], -1)
        body = self.bytes[np.cumsum(is_part[:-1], dtype=np.int8).astype(bool)]
        start = np.concatenate([[0], np.cumsum(size)])[:-1]
        offset = self.word[self.first[lines]] - self.start[lines] + start
        body[offset] = 32
        wide = body[np.minimum(offset + 1, len(body) - 1)]
        body[(offset + 1)[~_BLANK[wide]]] = 32
        for at in np.flatnonzero(body == HASH).tolist():
            stop = start[np.searchsorted(start, at, side="right") - 1 :][:2]
            body[at : stop[1] if len(stop) == 2 else len(body)] = 32
        blank = _BLANK[body]
        begins = ~blank
        begins[1:] &= blank[:-1]
        n_words = np.add.reduceat(begins, start, dtype=np.int32) if len(lines) else np.zeros(0, dtype=np.int32)
        body[start + size - 1] = 32
        return body, n_words, np.flatnonzero(begins)

    def numbers(self, word, least, most):
        """The first `most` numbers of each line that starts with `word`: (k, most) float64, the line of each.

        A line has at least `least` numbers; those it lacks are 0.  Raises BadLine.
        """
        lines = self.of(word)
        body, n_words, _ = self.without_comments(lines)
        short = np.flatnonzero(n_words < least)
        if len(short):
            raise self.bad(lines[short[0]], f"expected {least} numbers after `{word}`")
        values = _converted(body, np.float64)
        if values is None or len(values) != n_words.sum():
            raise self._not_a_number(lines, f"expected {least} numbers after `{word}`")
        out = np.zeros((len(lines), most))
        start = np.concatenate([[0], np.cumsum(n_words)])[:-1]
        for k in range(most):
            has = n_words > k
            out[has, k] = values[start[has] + k]
        bad = np.flatnonzero(~(np.abs(out) <= 1e100).all(axis=1))
        if len(bad):
            raise self.bad(lines[bad[0]], "expected finite numbers within 1e100")
        return out, lines

    def corners(self):
        """Corners of all `f` lines: (c, 3) int64 position, texture and normal indices as written, 0 where left out,
        the number of corners of each face, and its line.  Raises BadLine.
        """
        lines = self.of("f")
        body, n_words, word = self.without_comments(lines)
        short = np.flatnonzero(n_words < 3)
        if len(short):
            raise self.bad(lines[short[0]], "a face has at least 3 corners")
        if not len(lines):
            return np.zeros((0, 3), dtype=np.int64), n_words, lines
        is_slash = body == SLASH
        double = is_slash.copy()
        double[1:] &= is_slash[:-1]
        double[0] = False
        n_slash, n_double = (np.add.reduceat(flags, word, dtype=np.int32) for flags in (is_slash, double))
        form = n_slash + 3 * n_double  # 0: v, 1: v/t, 2: v/t/n, 5: v//n
        body[is_slash] = 32
        values = _converted(body, np.int64)
        width = np.select([form == 0, form == 1, form == 2, form == 5], [1, 2, 3, 2], 0)
        if values is None or not width.all() or len(values) != width.sum():
            return self._corners_slowly(lines)
        at = np.concatenate([[0], np.cumsum(width)])[:-1]
        out = np.zeros((len(word), 3), dtype=np.int64)
        out[:, 0] = values[at]
        has_t, has_n = (form == 1) | (form == 2), (form == 2) | (form == 5)
        out[has_t, 1] = values[at[has_t] + 1]
        out[has_n, 2] = values[at[has_n] + width[has_n] - 1]
        return out, n_words, lines

    def _corners_slowly(self, lines):
        """As corners, word by word: for files that write `1/` or `1/2/`, and to find the faulty line."""
        out, count = [], []
        for line in lines.tolist():
            words = self.text(line).split("#")[0].split()[1:]
            for one in words:
                if not re.fullmatch(r"[-+]?\d{1,18}(/([-+]?\d{1,18})?){0,2}", one):
                    raise self.bad(line, "expected corners like 1, 1/2, 1//3 or 1/2/3", one)
                out.append([int(part) if part else 0 for part in (one.split("/") + ["", ""])[:3]])
            count.append(len(words))
        return np.array(out, dtype=np.int64), np.array(count, dtype=np.int32), lines

    def _not_a_number(self, lines, what):
        for line in lines.tolist():
            for one in self.text(line).split("#")[0].split()[1:]:
                if not re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", one):
                    return self.bad(line, what, one)
        return self.bad(lines[0], what)

    def bad(self, index, what, word=None):
        """The BadLine to raise about line `index`, showing the word that is wrong, or the line."""
        return BadLine(int(self.number[index]), f"{what}, found '{(word or self.text(index))[:40]}'")


class BadLine(ValueError):
    """What is wrong in a line, and its `number` (from 1)."""

    def __init__(self, number, what):
        super().__init__(what)
        self.number = number


def _converted(body, dtype):
    """Numbers in bytes of blanks and numbers, or None if something else is there."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(body.tobytes(), dtype=dtype, sep=" ") if body.size else np.zeros(0, dtype)
        except (DeprecationWarning, ValueError):
            return None

"""Numbers as people read them. None becomes a dash."""

DASH = "\u2013"


def count(n):
    """A whole number with thousands apart, or shortened from a million on.

    >>> count(12345), count(3_240_000), count(None)
    ('12\\u202f345', '3.24 M', '\\u2013')
    """
    if n is None:
        return DASH
    for size, letter in ((1e9, "G"), (1e6, "M")):
        if abs(n) >= size:
            return f"{n / size:.3g} {letter}"
    return f"{n:,.0f}".replace(",", "\u202f")


def number(x, digits=3):
    """A measured number with some digits.

    >>> number(0.012345), number(1234.5), number(0), number(None)
    ('0.0123', '1234', '0', '\\u2013')
    """
    if x is None:
        return DASH
    if abs(x) >= 10**digits:
        return f"{x:.0f}"
    return f"{x:.{digits}g}"


def size(n):
    """Bytes.

    >>> size(512), size(65536), size(3_500_000)
    ('512 B', '64 KiB', '3.34 MiB')
    """
    if n is None:
        return DASH
    for unit, name in ((2**30, "GiB"), (2**20, "MiB"), (2**10, "KiB")):
        if n >= unit:
            return f"{n / unit:.3g} {name}" if n < 1000 * unit else f"{n / unit:.0f} {name}"
    return f"{n:.0f} B"


def share(x, digits=2):
    """A share in per cent.

    >>> share(0.0123), share(1), share(None)
    ('1.2 %', '100 %', '\\u2013')
    """
    return DASH if x is None else f"{number(100 * x, max(digits, 3 if abs(x) >= 0.995 else digits))} %"


def length(x):
    """A length in metres.

    >>> length(0.00012), length(0.034), length(2.5)
    ('0.12 mm', '34 mm', '2.5 m')
    """
    if x is None:
        return DASH
    return f"{number(1000 * x)} mm" if abs(x) < 1 else f"{number(x)} m"

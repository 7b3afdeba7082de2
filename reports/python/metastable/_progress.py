"""How far a computation is: a line on a terminal, a bar in a notebook, or a function of one's own."""

import contextlib
import sys
import time

from metastable._errors import InputTypeError


def _remaining(seconds):
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class _Shown:
    """Words that are shown from the first half second on, at most five times a second, and wiped at the end.

    How far a part is is said once its share is above 0, and how long it takes while the share moves: where it has stood
    still for a tenth of the time, the next stage takes longer than was foreseen, and no one knows how long.
    """

    def __init__(self, label):
        self._label, self._began, self._last, self._drawn = label, time.monotonic(), 0.0, False
        self._part, self._share, self._start, self._moved = "", 0.0, self._began, self._began

    def __call__(self, share, doing=""):
        now = time.monotonic()
        if doing != self._part:
            self._part, self._start = doing, now if self._part else self._began
        if share != self._share:
            self._share, self._moved = share, now
        if now - self._began < 0.5 or now - self._last < 0.2:
            return
        self._last, self._drawn = now, True
        elapsed = now - self._start
        words = f"{self._label}: {doing}" if doing and doing != self._label else self._label
        if share > 0:
            words += f"  {100 * share:.0f} %"
        if elapsed > 2 and 0.01 < share < 1 and now - self._moved <= max(2, elapsed / 10):
            words += f", about {_remaining(elapsed * (1 - share) / share)} left"
        self.draw(share, words)

    def again(self):
        """Shows the same once more: time has passed."""
        self(self._share, self._part)

    def close(self):
        if self._drawn:
            self.wipe()


class Line(_Shown):
    """On a terminal (standard error)."""

    def draw(self, share, words):
        print(f"\r\033[K{words}", end="", file=sys.stderr, flush=True)

    def wipe(self):
        print("\r\033[K", end="", file=sys.stderr, flush=True)


class Bar(_Shown):
    """In a notebook."""

    _display = None

    def draw(self, share, words):
        from IPython.display import HTML, display

        shown = HTML(f'<progress value="{share:.3f}" style="width:20em"></progress> {words}')
        if self._display is None:
            self._display = display(shown, display_id=True)
        else:
            self._display.update(shown)

    def wipe(self):
        from IPython.display import HTML

        self._display.update(HTML(""))


@contextlib.contextmanager
def telling(progress, label):
    """What the library calls with (share done, what is being done), or None.

    progress: None shows where someone watches, a terminal or a notebook; True and False always and never; a function is
    called with the share of the work done, 0 to 1.
    """
    notebook = "ipykernel" in sys.modules
    if progress is None:
        progress = notebook or (sys.stderr is not None and sys.stderr.isatty())
    if progress is False:
        yield None
    elif progress is True:
        shown = Bar(label) if notebook else Line(label)
        try:
            yield shown
        finally:
            shown.close()
    elif callable(progress):
        yield lambda share, doing: progress(share)
    else:
        raise InputTypeError(f"progress: None, True, False or a function expected, not {type(progress).__name__}")

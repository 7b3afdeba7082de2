"""What goes wrong, by the exit codes of the command line: 2 is an InputError, 3 a ComputationError."""


class InputError(ValueError):
    """An argument, a file or a folder that cannot be: a sentence that names what, where and the allowed range."""

    @property
    def lines(self):
        """All that is wrong, a line each (files are told with FILE:LINE:COLUMN)."""
        return str(self).split("\n")


class InputTypeError(InputError, TypeError):
    """An argument of the wrong kind, as a text for a number; what a step returns, too. It is a TypeError as well."""


class ComputationError(RuntimeError):
    """A computation that failed: a solver that did not reach its accuracy, or memory that does not suffice."""


class Contradiction(ComputationError):
    """Two ways to one number that share little disagree by more than their errors allow: no number is given."""


class MapError(ComputationError):
    """A simulator broke its promises; the sentence names the state: a landing that is not finite, a noise-free orbit
    that fails, does not settle or is unstable, failures out of reach."""


for kind in (InputError, InputTypeError, ComputationError, Contradiction, MapError):
    kind.__module__ = "metastable"  # where people find them
del kind

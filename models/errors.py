"""The one family of errors that users see: a clear sentence each; the command line turns it into exit code 2."""


class TilestampError(ValueError):
    """Bad input: a file, an option or a description that cannot be used, said in one sentence."""


class UnableError(TilestampError):
    """What was chosen cannot do it; ``instead`` has a choice that can, by the name of what is chosen (``machine``)."""

    def __init__(self, sentence: str, **instead: str) -> None:
        super().__init__(sentence)
        self.instead = instead


class MissingInputError(TilestampError):
    """A scene or a measurement that is not at hand: the sentence says where it goes."""

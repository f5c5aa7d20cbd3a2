"""The one family of errors that users see: a clear sentence each; the command line turns it into exit code 2."""


class TilestampError(ValueError):
    """Bad input: a file, an option or a description that cannot be used, said in one sentence."""


class MissingInputError(TilestampError):
    """A scene or a measurement that is not at hand: the sentence says where it goes."""

"""What a reader has to say about a file that it could read."""


class Notes(list[str]):
    """What was skipped, guessed or could not be represented: sentences without their full stop, each once."""

    def add(self, sentence: str) -> None:
        """Add one, unless it is there."""
        if sentence not in self:
            self.append(sentence)

    def add_if(self, condition: object, sentence: str) -> None:
        """Add one where something is so."""
        if condition:
            self.add(sentence)

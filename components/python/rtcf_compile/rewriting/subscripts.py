"""The subscripts of np.einsum, such as `ij,j->i`."""

MOST_OPERANDS = 3
MOST_DIMENSIONS = 3


class Subscripts:
    """The subscripts of the operands and of the result."""

    def __init__(self, text: str) -> None:
        """Parse a text; raise ValueError, with the error and a remedy, if it is not supported."""
        self.text = text
        given, arrow, result = text.replace(" ", "").partition("->")
        self.operands = given.split(",")
        every = "".join(self.operands)
        if "." in text:
            raise ValueError("... stands for any number of subscripts", "write them: 'ij,j->i'")
        if not arrow:
            # Without ->, those that occur once are kept, in alphabetical order.
            result = "".join(sorted(each for each in set(every) if every.count(each) == 1))
        self.result = result
        names = f"{every}{result}"
        if not (names.isascii() and names.isalpha()) and names:
            raise ValueError("subscripts are letters", "write 'ij,j->i'")
        if len(set(result)) < len(result) or not set(result) <= set(every):
            raise ValueError(
                f"the result {result} has subscripts that are not those of the operands",
                "write each subscript once behind ->",
            )
        if max(map(len, (*self.operands, result))) > MOST_DIMENSIONS:
            raise ValueError(
                f"arrays have at most {MOST_DIMENSIONS} dimensions", "use parts of the arrays"
            )
        if self.is_view and len(self.operands[0]) > 2:
            raise ValueError("this is a view of a block", "write a loop over its matrices")
        if len(self.operands) > MOST_OPERANDS:
            raise ValueError(
                f"more than {MOST_OPERANDS} operands", "write two calls, or use @ and *"
            )

    @property
    def summed(self) -> str:
        """The subscripts over which the result sums, in the order of the loops."""
        return "".join(
            dict.fromkeys(each for each in "".join(self.operands) if each not in self.result)
        )

    @property
    def is_view(self) -> bool:
        """Tell whether NumPy returns a view of its operand."""
        return len(self.operands) == 1 and bool(self.result) and not self.summed

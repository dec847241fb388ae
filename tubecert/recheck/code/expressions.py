"""Words that are taken one after the other, and the expressions that they make."""

from __future__ import annotations

from tubecert.recheck.code.tree import Binary, Call, Choice, Entry, Expr, Member, Name, Number, Unary
from tubecert.recheck.code.words import UnreadError, Word

_LEVELS = (("||",), ("&&",), ("<", ">", "<=", ">=", "=="), ("+", "-"), ("*", "/"))


class Words:
    """Words that are taken one after the other, and expressions of them."""

    def __init__(self, own: list[Word]) -> None:
        self._words, self._place = own, 0

    @property
    def next(self) -> Word:
        """The next word."""
        return self._words[self._place]

    def refused(self, what: str = "") -> UnreadError:
        """The error for the next word."""
        word = self.next
        return UnreadError(f"line {word.line}: {what or f'{word.text!r} does not belong here'}")

    def take(self, *texts: str) -> str:
        """The next word, which is one of these."""
        if self.next.text not in texts:
            raise self.refused()
        self._place += 1
        return self._words[self._place - 1].text

    def took(self, *texts: str) -> bool:
        """Takes the next words if they are these."""
        found = [word.text for word in self._words[self._place : self._place + len(texts)]]
        if found == list(texts):
            self._place += len(texts)
        return found == list(texts)

    def name(self) -> str:
        """The next word, which is a name."""
        if self.next.kind != "name":
            raise self.refused()
        self._place += 1
        return self._words[self._place - 1].text

    def expression(self) -> Expr:
        """An expression."""
        test = self._level(0)
        if not self.took("?"):
            return test
        yes = self.expression()
        self.take(":")
        return Choice(test, yes, self.expression())

    def _level(self, k: int) -> Expr:
        if k == len(_LEVELS):
            return self._unary()
        found = self._level(k + 1)
        while self.next.text in _LEVELS[k]:
            sign = self.take(*_LEVELS[k])
            found = Binary(sign, found, self._level(k + 1))
        return found

    def _unary(self) -> Expr:
        if self.took("(", "real", ")"):
            return Unary("real", self._unary())
        if self.next.text in ("-", "!", "&"):
            return Unary(self.take("-", "!", "&"), self._unary())
        return self._with_places(self.primary())

    def primary(self) -> Expr:
        """A number, a name, a call, or an expression in brackets."""
        if self.took("("):
            found = self.expression()
            self.take(")")
            return found
        if self.next.kind == "number":
            self._place += 1
            return Number(self._words[self._place - 1].text)
        name = self.name()
        return Call(name, self.arguments()) if self.took("(") else Name(name)

    def arguments(self) -> tuple[Expr, ...]:
        """Behind the bracket that opens."""
        if self.took(")"):
            return ()
        found = [self.expression()]
        while self.take(",", ")") == ",":
            found.append(self.expression())
        return tuple(found)

    def _with_places(self, base: Expr) -> Expr:
        while self.next.text in ("[", "->"):
            if self.took("->"):
                base = Member(base, self.name())
            else:
                self.take("[")
                base = Entry(base, self.expression())
                self.take("]")
        return base

    def sizes(self) -> tuple[Expr, ...]:
        """What stands in square brackets, pair by pair."""
        found = []
        while self.took("["):
            found.append(self.expression())
            self.take("]")
        return tuple(found)

"""What the feedback and the clip look like in the code: (H.37), and the projections of (H.5)."""

from __future__ import annotations

from dataclasses import dataclass

from tubecert.recheck.code.tree import (
    Assign,
    Binary,
    Call,
    Choice,
    Declare,
    Entry,
    Expr,
    Function,
    Name,
    Number,
    Unary,
)
from tubecert.recheck.code.words import UnreadError


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """kappa = -(min(max(excess, 0)/norm, gain sqrt(max(square, 0)))/norm) c, norm = sqrt(max(c'c, least))."""

    c: tuple[Expr, ...]
    excess: Expr
    gain: str
    least: str


class Straight:
    """A function without branches, of which every variable is written once."""

    def __init__(self, own: Function) -> None:
        self.name, self.found, self.written = own.name, dict[str, Expr](), dict[tuple[str, int], Expr]()
        for each in own.body:
            match each:
                case Declare("real", name, (), value) if value is not None and name not in self.found:
                    self.found[name] = value
                case Assign(Entry(Name(name), Number(index)), value) if (
                    name,
                    int(index),
                ) not in self.written:
                    self.written[name, int(index)] = value
                case _:
                    raise UnreadError(f"{own.name} is no straight line")

    def meant(self, tree: Expr) -> Expr:
        """What a variable is."""
        while isinstance(tree, Name) and tree.name in self.found:
            tree = self.found[tree.name]
        return tree

    def row(self, name: str, size: int) -> list[Expr]:
        """What is written to a vector."""
        try:
            return [self.written[name, k] for k in range(size)]
        except KeyError:
            raise UnreadError(f"{self.name} does not write all of {name}") from None

    def product(self, tree: Expr) -> tuple[Expr, Expr]:
        """The two factors."""
        return self._two("*", tree)

    def quotient(self, tree: Expr) -> tuple[Expr, Expr]:
        """What is divided, and by what."""
        return self._two("/", tree)

    def _two(self, sign: str, tree: Expr) -> tuple[Expr, Expr]:
        match self.meant(tree):
            case Binary(own, left, right) if own == sign:
                return left, right
        raise self.other()

    def other(self) -> UnreadError:
        """It is of another form."""
        return UnreadError(f"{self.name} is of another form")

    def root(self, tree: Expr) -> Expr:
        """The argument of a root."""
        match self.meant(tree):
            case Call("sqrt" | "sqrtf", (arg,)):
                return arg
        raise self.other()

    def extreme(self, sign: str, tree: Expr) -> tuple[Expr, Expr]:
        """`>`: of which two it is the larger one; `<`: the smaller one."""
        match self.meant(tree):
            case Choice(Binary(own, a, b), yes, no) if own == sign and (a, b) == (yes, no):
                return a, b
        raise self.other()

    def squares(self, tree: Expr, of: tuple[Expr, ...]) -> bool:
        """Whether it is the sum of these squares, from the left."""
        tree = self.meant(tree)
        for each in reversed(of[1:]):
            match tree:
                case Binary("+", left, right) if self.meant(right) == Binary("*", each, each):
                    tree = self.meant(left)
                case _:
                    return False
        return tree == Binary("*", of[0], of[0])

    def literal(self, tree: Expr) -> str:
        """A number as it is written."""
        match tree:
            case Number(text):
                return text
            case Unary("-", Number(text)):
                return f"-{text}"
        raise self.other()

    def above(self, tree: Expr) -> Expr:
        """What is not let below 0."""
        own, nothing = self.extreme(">", tree)
        if self.literal(nothing) not in ("0.0", "0.0f"):
            raise self.other()
        return own


def law_of(own: Function, m: int) -> Law:
    """The feedback; raises `UnreadError` where it is of another form."""
    s = Straight(own)
    square, excess, size = s.row("out_told", 3)
    pairs = []
    for tree in s.row("out_kappa", m):
        match s.meant(tree):
            case Unary("-", arg):
                pairs.append(s.product(arg))
            case _:
                raise s.other()
    share = pairs[0][0]
    wanted_least, norm = s.quotient(share)
    wanted, limit = s.extreme("<", wanted_least)
    above, by = s.quotient(wanted)
    gain, root = s.product(limit)
    bounded, least = s.extreme(">", s.root(norm))
    c = tuple(each for _, each in pairs)
    agree = (
        all(own == share for own, _ in pairs),
        by == norm,
        s.above(above) == excess,
        s.above(s.root(root)) == square,
        bounded == size,
        s.squares(size, c),
    )
    if not all(agree):
        raise s.other()
    return Law(c=c, excess=excess, gain=s.literal(gain), least=s.literal(least))


def box_of(own: Function, m: int) -> tuple[tuple[str, str], ...] | None:
    """The ends of the box that q is clipped to; None where it is clipped to a ball."""
    s = Straight(own)
    found = []
    for q, tree in zip(s.row("out_q", m), s.row("out_estimate", m), strict=True):
        match s.meant(tree):
            case Choice():
                inner, high = s.extreme("<", tree)
                lower, low = s.extreme(">", inner)
                if lower != q:
                    raise s.other()
                found.append((s.literal(low), s.literal(high)))
            case _:
                return None
    return tuple(found)


def ball_of(own: Function, m: int) -> str:
    """The radius of the ball that q is clipped to."""
    s = Straight(own)
    q = tuple(s.row("out_q", m))
    pairs = [s.product(tree) for tree in s.row("out_estimate", m)]
    share = pairs[0][0]
    match s.meant(share):
        case Choice(Binary(">", size, radius), Binary("/", p, r), Number("1.0" | "1.0f")):
            fits = (size, radius) == (r, p) and s.squares(s.root(size), q)
            if fits and all(pair == (share, each) for pair, each in zip(pairs, q, strict=True)):
                return s.literal(radius)
    raise s.other()

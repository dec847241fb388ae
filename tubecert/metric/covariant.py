"""Norms of covariant derivatives in the metric, over boxes: what certificate H needs of a metric that is not constant.

In: expressions of W, F, f, B and their derivatives. Out: objectives whose values are norms of tensors, measured by the
metric in every index. With all indices raised the Christoffel symbols are free of M: with W^a = W^ai dW/dx_i,
    Gamma^kab = (-(W^a)_kb - (W^b)_ka + (W^k)_ab)/2,
and the covariant derivatives of F and of a vector field X are
    (D^a F)_kl = (F^a)_kl + Gamma^kac (M F)_cl + Gamma^lac (M F)_ck,    (D^b X)_k = (X_x W)_kb + Gamma^kbc (M X)_c.
Tensors are computed in a frame, proposed for each box, in which W is nearly the identity, to second order.
Implements: theory 8. Trusted: yes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from tubecert.coordinates import Fields
from tubecert.enclosure.forms import Form, Forms, contract, least_norm, stacked, thin, unfolded_norm
from tubecert.enclosure.interval import Array
from tubecert.enclosure.linalg import norm_bound, whitening
from tubecert.enclosure.objective import Estimate, Target
from tubecert.expression import ZERO
from tubecert.expression.matrix import Matrix, column, differentiate, jacobian
from tubecert.metric.geodesic import alternating, contracted
from tubecert.model import ControlAffineModel

_SLACK = 1e-13  # as in `enclosure.forms`: sums of up to 900 terms (Higham 2002, eq. 3.5)
_ENTRIES = 1_000_000  # of the largest tensor of a batch


@dataclass(frozen=True, slots=True, kw_only=True)
class Frame:
    """Over every box: T with T W T' between `least` and `most` times I, and an enclosure of (T W T')^-1.

    `varies` (N, d) is how much W varies with each variable, against its middle; it only steers a search.
    """

    T: Form
    raised: Form  # T W
    M: Form
    least: Array
    most: Array
    varies: Array

    def both(self, a: Form) -> Form:
        """T A T' of one matrix."""
        return contract("ij,kj->ik", contract("ij,jk->ik", self.T, a), self.T)

    def each(self, a: Form) -> Form:
        """T A_i T' of a stack of matrices."""
        return contract("aij,kj->aik", contract("ij,ajk->aik", self.T, a), self.T)

    def along(self, moving: Sequence[int], a: Form) -> Form:
        """W^ai A_i in the frame, for the A_i of the states that move."""
        weights = Form(self.raised.parts[..., list(moving)], self.raised.radius[..., list(moving)])
        return contract("ai,ikl->akl", weights, self.each(a))


def frame_of(W: Form) -> Frame:
    """The frame N T: T makes the middle of W nearly the identity, and N = I - (T W T' - I)/2 the rest of it."""
    count, n = len(W.parts) - 1, W.parts.shape[-1]
    t = thin(whitening(W.parts[0]), count)
    eye = thin(np.broadcast_to(np.eye(n), t.radius.shape).copy(), count)
    near = contract("ij,kj->ik", contract("ij,jk->ik", t, W), t)
    N = eye - 0.5 * (near - eye)
    T = contract("ij,jk->ik", N, t)
    scaled = contract("ij,kj->ik", contract("ij,jk->ik", N, near), N)
    off = norm_bound((scaled - eye).size) * (1 + _SLACK)
    off = np.where(off < 1, off, np.nan)  # where nothing is proven, nothing is: NaN
    wide = off / (1 - off) * (1 + _SLACK)
    M = Form(eye.parts, np.broadcast_to(wide[:, None, None], eye.radius.shape))
    raised = contract("ij,jk->ik", T, W)
    varies = np.array([norm_bound(np.abs(part)) for part in near.parts[1:]]).reshape(count, -1).T
    least, most = np.nextafter(1 - off, 0), np.nextafter(1 + off, 2)
    return Frame(T=T, raised=raised, M=M, least=least, most=most, varies=varies)


Tensor = Callable[[Frame, list[Form]], Form]
On = Callable[[Matrix], Matrix]


class MetricTensorNorm:
    """The least spectral norm of some unfoldings of a tensor whose last axes are measured by the metric.

    `tensor` computes it from the forms of `matrices`, given the frame of W; the last `rank` of its axes are in the
    frame. It is an upper bound of the norm of the multilinear map, and that itself for a matrix.
    """

    def __init__(
        self,
        W: Matrix,
        matrices: Sequence[Matrix],
        tensor: Tensor,
        *,
        rank: int,
        rows: Sequence[tuple[int, ...]],
        fixed: frozenset[str] = frozenset(),
    ) -> None:
        self._forms = Forms([W, *matrices], fixed)
        self.variables = self._forms.variables
        self._tensor, self._rank, self._rows = tensor, rank, rows
        self._most = max(1, _ENTRIES // (len(W) ** 4 * (1 + len(self.variables))))

    def _at(self, lo: Array, hi: Array) -> tuple[Frame, Form]:
        W, *others = self._forms.over(lo, hi)
        frame = frame_of(W)
        return frame, self._tensor(frame, others)

    def upper(self, lo: Array, hi: Array, target: Target) -> Estimate:
        """The norm of the affine part at its vertices plus that of the rest."""
        parts = [
            self._upper(lo[i : i + self._most], hi[i : i + self._most]) for i in range(0, len(lo), self._most)
        ]
        value, grown = (np.concatenate(x) for x in zip(*parts, strict=True))
        grown = np.where(hi > lo, grown, 0.0)
        return Estimate(value, 0.5 * lo + 0.5 * hi, grown, grown)

    def _upper(self, lo: Array, hi: Array) -> tuple[Array, Array]:
        frame, tensor = self._at(lo, hi)
        norms = [unfolded_norm(tensor, rows) for rows in self._rows]
        value = np.min([value for value, _ in norms], axis=0)
        # x has length 1 in the metric where T' ^-1 x is at most 1/sqrt(least) long
        value = value / frame.least ** (self._rank / 2) * (1 + _SLACK)
        # where W is not even known to be positive definite, only what varies it helps
        endless = ~np.isfinite(value)
        grown = np.where(endless[:, None], frame.varies, norms[0][1])
        return np.where(endless, np.inf, value), grown

    def lower(self, lo: Array, hi: Array) -> Array:
        """The same at points, from below."""
        frame, tensor = self._at(lo, hi)
        norms = np.min([least_norm(tensor, rows).lo for rows in self._rows], axis=0)
        return np.asarray(norms / frame.most ** (self._rank / 2) * (1 - _SLACK))

    def attained(self, at: Mapping[str, float]) -> float:
        """What the multilinear map itself reaches at a point: |T(v, w, ...)|/(|v| |w| ...) of chosen vectors."""
        if any(name not in at for name in self.variables):
            return 0.0
        point = np.array([[at[name] for name in self.variables]])
        with np.errstate(all="ignore"):
            frame, tensor = self._at(point, point)
        if not (np.isfinite(tensor.size).all() and np.isfinite(frame.most).all()):
            return 0.0
        mid, error = tensor.parts[0][0], tensor.size[0] - np.abs(tensor.parts[0][0]) + _SLACK * tensor.size[0]
        vectors = alternating(mid)
        value = abs(contracted(mid, vectors)) - contracted(error, [np.abs(v) for v in vectors]) * (1 + _SLACK)
        scale = float(np.prod([np.linalg.norm(v) for v in vectors]) * frame.most[0] ** (self._rank / 2))
        return max(0.0, float(value / scale) * (1 - 10 * _SLACK))


@dataclass(frozen=True)
class Geometry:
    """The objectives for a model with a metric W(x); expressions in the states, and of inputs that stand for u*."""

    model: ControlAffineModel

    @cached_property
    def _moving(self) -> list[int]:
        """The states on which W depends."""
        return [i for i, slope in enumerate(self.model.W_x) if _moves(slope)]

    @cached_property
    def _slopes(self) -> list[Matrix]:
        return [self.model.W_x[i] for i in self._moving]

    def _raised(self, frame: Frame, slopes: Sequence[Form]) -> Form:
        """W^a, (a, k, l)."""
        return frame.along(self._moving, stacked(slopes))

    def _symbols(self, frame: Frame, slopes: Sequence[Form]) -> Form:
        """Gamma^kab, (k, a, b)."""
        raised = self._raised(frame, slopes)
        return 0.5 * (raised - raised.turned(1, 0, 2) - raised.turned(1, 2, 0))

    def slope_of_form(self) -> MetricTensorNorm:
        """D_nF: |D_v F| over vectors v of length 1, all in the metric."""
        model = self.model
        F_x = [differentiate(model.F, name) for name in model.states]
        own = [i for i, slope in enumerate(F_x) if _moves(slope)]
        matrices = [model.F, *self._slopes, *(F_x[i] for i in own)]
        return MetricTensorNorm(
            model.W, matrices, partial(self._turned_form, own), rank=3, rows=((0, 1), (0,))
        )

    def _turned_form(self, own: list[int], frame: Frame, forms: list[Form]) -> Form:
        """D^a F, (a, k, l); `own` are the states that F depends on."""
        count = len(self._moving)
        F, slopes, rest = forms[0], forms[1 : 1 + count], forms[1 + count :]
        lowered = contract("cd,dl->cl", frame.M, frame.both(F))
        turn = contract("kac,cl->akl", self._symbols(frame, slopes), lowered)
        found = turn + turn.turned(0, 2, 1)
        return found + frame.along(own, stacked(rest)) if own else found

    def slope_of_field(self, X: Matrix) -> MetricTensorNorm:
        """D_nX: |D X| in the metric of a vector field (n, 1)."""
        matrices = [X, _jacobian(X, self.model.states), *self._slopes]
        return MetricTensorNorm(self.model.W, matrices, self._of_field, rank=2, rows=((0,),))

    def _of_field(self, frame: Frame, forms: list[Form]) -> Form:
        return self._derivative(frame, forms[0], forms[1], forms[2:])

    def size_of_field(self, X: Matrix) -> MetricTensorNorm:
        """|Theta X| of a vector field (n, 1)."""
        return MetricTensorNorm(self.model.W, [X], _length, rank=1, rows=((0,),))

    def _derivative(self, frame: Frame, X: Form, X_x: Form, slopes: Sequence[Form]) -> Form:
        """(D^b X)_k, (k, b)."""
        straight = contract("kj,bj->kb", contract("ij,jk->ik", frame.T, X_x), frame.raised)
        lowered = contract("cd,dz->cz", frame.M, contract("ij,jz->iz", frame.T, X))
        return straight + _column(contract("kbc,cz->kbz", self._symbols(frame, slopes), lowered))

    def slope_of_inputs(self, on: On, fixed: frozenset[str]) -> MetricTensorNorm:
        """D_nb: |(<D_v b_j, z>)_j| over v and z of length 1 in the metric, of expressions on the plan."""
        model, rows = self.model, ((0, 1), (0, 2), (0,))
        columns = [column(b) for b in model.columns]
        matrices = [on(a) for a in (*columns, *(_jacobian(b, model.states) for b in columns), *self._slopes)]
        return MetricTensorNorm(on(model.W), matrices, self._of_inputs, rank=2, rows=rows, fixed=fixed)

    def _of_inputs(self, frame: Frame, forms: list[Form]) -> Form:
        m = len(self.model.inputs)
        return stacked([self._derivative(frame, forms[j], forms[m + j], forms[2 * m :]) for j in range(m)])

    def curvature(self) -> MetricTensorNorm:
        """K_R: the greatest |sectional curvature|, at most the norm of the curvature as a form of bivectors."""
        count = len(self._moving)
        pairs = [(i, j) for i in range(count) for j in range(count)]
        second = [differentiate(self._slopes[i], self.model.states[self._moving[j]]) for i, j in pairs]
        return MetricTensorNorm(self.model.W, [*self._slopes, *second], self._curved, rank=4, rows=((0,),))

    def _curved(self, frame: Frame, forms: list[Form]) -> Form:
        count = len(self._moving)
        return _bivectors(self._riemann(frame, forms[:count], forms[count:]))

    def _riemann(self, frame: Frame, slopes: Sequence[Form], second: Sequence[Form]) -> Form:
        """R_ijkl = (g_il,jk + g_jk,il - g_ik,jl - g_jl,ik)/2 + g_np (Gamma^n_jk Gamma^p_il - Gamma^n_jl Gamma^p_ik)."""
        raised, symbols = self._raised(frame, slopes), self._symbols(frame, slopes)
        count, moving = len(self._moving), self._moving
        # W M_ab W = -W_ab + W_a M W_b + W_b M W_a, a and b raised
        by_second = stacked(
            [frame.along(moving, stacked(second[i * count : (i + 1) * count])) for i in range(count)]
        )
        weights = Form(frame.raised.parts[..., moving], frame.raised.radius[..., moving])
        turn = contract("akd,bdl->abkl", contract("akc,cd->akd", raised, frame.M), raised)
        g = turn + turn.turned(1, 0, 2, 3) - contract("ai,ibkl->abkl", weights, by_second)
        straight = g.turned(2, 0, 1, 3) + g.turned(0, 2, 3, 1) - g.turned(2, 0, 3, 1) - g.turned(0, 2, 1, 3)
        square = contract("pjk,pil->ijkl", contract("njk,np->pjk", symbols, frame.M), symbols)
        return 0.5 * straight + square - square.turned(0, 1, 3, 2)

    # -- derivatives by coordinates ----------------------------------------------------------------------------

    def slope_by_coordinates(self, fields: Fields) -> MetricTensorNorm:
        """D_Fx: |T_v| in the metric over |v| = 1 in z, T_v = F_v - W_v M F - F M W_v."""
        matrices = [self.model.F, *fields.slopes(self.model.F), *fields.slopes(self.model.W)]
        return MetricTensorNorm(self.model.W, matrices, _by_coordinates, rank=2, rows=((0, 1), (0,)))

    def tilt_by_coordinates(self, fields: Fields, on: On, fixed: frozenset[str]) -> MetricTensorNorm:
        """D_cx: |(B_v' - B'M W_v) L^-1| over |v| = 1 in z, of expressions on the plan."""
        B, W = self.model.B, self.model.W
        matrices = [on(a) for a in (B, *fields.slopes(B), *fields.slopes(W))]
        return MetricTensorNorm(on(W), matrices, _tilted, rank=1, rows=((0, 1), (0, 2)), fixed=fixed)


def _length(frame: Frame, forms: list[Form]) -> Form:
    return contract("ij,jz->zi", frame.T, forms[0])


def _by_coordinates(frame: Frame, forms: list[Form]) -> Form:
    n = len(forms) // 2
    F, F_z, W_z = forms[0], frame.each(stacked(forms[1 : 1 + n])), frame.each(stacked(forms[1 + n :]))
    turn = contract("akc,cl->akl", W_z, contract("cd,dl->cl", frame.M, frame.both(F)))
    return F_z - (turn + turn.turned(0, 2, 1))


def _tilted(frame: Frame, forms: list[Form]) -> Form:
    n = len(forms) // 2
    B = contract("cd,dj->cj", frame.M, contract("ij,jk->ik", frame.T, forms[0]))
    B_z = contract("ij,ajm->ami", frame.T, stacked(forms[1 : 1 + n]))
    return B_z - contract("cm,ack->amk", B, frame.each(stacked(forms[1 + n :])))


def _column(a: Form) -> Form:
    """A tensor without its last axis, of length 1."""
    return Form(a.parts[..., 0], a.radius[..., 0])


def _bivectors(a: Form) -> Form:
    """A form R_ijkl of bivectors as a matrix, i < j against k < l."""
    n = a.radius.shape[-1]
    i, j = np.triu_indices(n, 1)
    at = (i[:, None], j[:, None], i[None], j[None])
    return Form(a.parts[(..., *at)], a.radius[(..., *at)])


def _moves(a: Matrix) -> bool:
    return any(e is not ZERO for row in a for e in row)


def _jacobian(X: Matrix, states: Sequence[str]) -> Matrix:
    return jacobian([row[0] for row in X], states)

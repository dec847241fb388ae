"""Named tuples of compiled loops behind pointers.

Numba passes every word of every member of a tuple, hundreds for what a lane reads and writes, and most of a compilation
is then spent on moving them. `pointed` leaves a tuple where it is and hands on its address: a member is one load, a
tuple within it is the address of that part.
"""

from __future__ import annotations

from llvmlite import ir
from numba.core import cgutils, types, typing
from numba.core.base import BaseContext
from numba.core.datamodel import DataModelManager, models
from numba.core.extending import intrinsic, lower_getattr_generic, register_model
from numba.core.imputils import impl_ret_untracked
from numba.core.typing.templates import AttributeTemplate, infer_getattr


class Pointed(types.Type):  # type: ignore[misc]
    """The address of a tuple of a type, which is on the stack of a caller."""

    def __init__(self, whole: types.BaseTuple) -> None:
        self.whole = whole
        super().__init__(name=f"Pointed({whole})")


@register_model(Pointed)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: DataModelManager, fe_type: Pointed) -> None:
        super().__init__(dmm, fe_type, dmm.lookup(fe_type.whole).get_value_type().as_pointer())


@infer_getattr
class _Members(AttributeTemplate):  # type: ignore[misc]
    key = Pointed

    def generic_resolve(self, pointed: Pointed, name: str) -> types.Type | None:
        """The type of a member."""
        fields = pointed.whole.fields
        if name not in fields:
            return None
        part = pointed.whole[fields.index(name)]
        return Pointed(part) if isinstance(part, types.BaseTuple) else part


@lower_getattr_generic(Pointed)  # type: ignore[untyped-decorator]
def _member(
    context: BaseContext, builder: ir.IRBuilder, pointed: Pointed, address: ir.Value, name: str
) -> ir.Value:
    number = pointed.whole.fields.index(name)
    part = pointed.whole[number]
    place = cgutils.gep_inbounds(builder, address, 0, number)
    if isinstance(part, types.BaseTuple):
        return place
    return impl_ret_untracked(context, builder, part, builder.load(place))


@intrinsic  # type: ignore[untyped-decorator]
def pointed(context: typing.BaseContext, whole: types.BaseTuple) -> object:
    """The address of a copy of a tuple, for as long as the caller runs."""
    found = Pointed(whole)

    def generate(
        context: BaseContext, builder: ir.IRBuilder, signature: typing.Signature, arguments: list[ir.Value]
    ) -> ir.Value:
        return cgutils.alloca_once_value(builder, arguments[0])

    return found(whole), generate

"""``[[object]]``: what stands around simulated arms and can be touched."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from hil.config.frames import PoseConfig
from hil.values.surroundings import SIZES, SceneObject, Shape

_MM = 1e-3


class ObjectConfig(PoseConfig):
    """One object, by the pose of its middle in the world."""

    name: Annotated[str, Field(min_length=1, max_length=40, pattern=r"^[\w-]+$", description="name of the object")]
    shape: Annotated[Shape, Field(description="box, cylinder, sphere or plane")] = Shape.BOX
    size_mm: Annotated[
        tuple[Annotated[float, Field(gt=0.0, le=100_000.0)], ...],
        Field(description="box: lengths along x, y, z; cylinder: diameter, height; sphere: diameter; plane: none"),
    ] = ()
    mass_kg: Annotated[
        float | None, Field(gt=0.0, le=1000.0, description="mass of a body that can be moved; default: it stands fast")
    ] = None
    friction: Annotated[float, Field(ge=0.0, le=5.0, description="sliding friction")] = 1.0
    colour: Annotated[str, Field(pattern=r"^#[0-9a-fA-F]{6}$", description="colour, #rrggbb")] = "#8c949e"

    @model_validator(mode="after")
    def _sizes_fit(self) -> Self:
        wanted = SIZES[self.shape]
        if len(self.size_mm) != wanted:
            raise ValueError(f"a {self.shape} has {wanted} sizes, {len(self.size_mm)} are given (size_mm)")
        if self.shape is Shape.PLANE and self.mass_kg is not None:
            raise ValueError("a plane stands fast and has no mass")
        return self

    def scene_object(self) -> SceneObject:
        """Return it in SI units."""
        red, green, blue = (int(self.colour[at : at + 2], 16) / 255.0 for at in (1, 3, 5))
        return SceneObject(
            name=self.name,
            shape=self.shape,
            size_m=tuple(size * _MM for size in self.size_mm),
            pose=self.pose(),
            mass_kg=self.mass_kg,
            friction=self.friction,
            colour=(red, green, blue),
        )

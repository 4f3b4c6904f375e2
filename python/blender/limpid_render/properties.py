"""Properties of a scene's liquid."""

import bpy
from bpy.props import (
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

_COLORMAPS = ("Viridis", "Plasma", "Inferno", "Magma", "Cividis", "Turbo", "Coolwarm", "Spectral")


class LimpidSettings(bpy.types.PropertyGroup):
    """Settings of limpid, one group for each scene."""

    source: EnumProperty(
        name="Source",
        description="Where the particles of the liquid come from",
        items=[
            ("FILE", "Files", "Particle files of a simulation"),
            ("OBJECT", "Object", "An object's particle systems, points, instances or vertices"),
        ],
        default="FILE",
    )
    object: PointerProperty(
        name="Object",
        description=(
            "Its particle systems are the liquid; else what Geometry Nodes make: points, "
            "instances; else its vertices. Its surface is not drawn"
        ),
        type=bpy.types.Object,
    )
    particles: StringProperty(
        name="Particles",
        description=(
            "A particle file, or the pattern of a sequence, with #### or {} for the frame's number"
        ),
        subtype="FILE_PATH",
    )
    offset: IntProperty(
        name="Frame Offset",
        description="The number of the file is the current frame minus this offset",
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of a particle; 0 takes the file's, or estimates it from the spacing",
        subtype="DISTANCE",
        min=0.0,
        precision=4,
    )
    up: EnumProperty(
        name="Up Axis",
        description="The axis that points up in the file",
        items=[
            ("Y", "Y", "The file has y up, as most simulators do"),
            ("Z", "Z", "The file has z up, as Blender does"),
        ],
        default="Y",
    )
    ior: FloatProperty(
        name="IOR",
        description="Index of refraction",
        default=1.33,
        min=0.3,
        max=3.0,
    )
    tint: EnumProperty(
        name="Tint",
        description="How the colour of the liquid is given",
        items=[
            ("ABSORPTION", "Absorption", "Absorption coefficients, 1/m"),
            ("COLOR", "Colour", "The colour of white light behind one metre of the liquid"),
        ],
        default="ABSORPTION",
    )
    absorption: FloatVectorProperty(
        name="Absorption",
        description="Absorption coefficients of red, green and blue light, 1/m",
        size=3,
        default=(1.2, 0.35, 0.12),
        min=0.0,
    )
    color: FloatVectorProperty(
        name="Colour",
        description="The colour of white light behind one metre of the liquid",
        subtype="COLOR",
        size=3,
        default=(0.3, 0.7, 0.89),
        min=1e-4,
        max=1.0,
    )
    attribute: StringProperty(
        name="Colour By",
        description="An attribute of the particles whose values, or colours, the liquid shows",
    )
    colormap: EnumProperty(
        name="Colour Map",
        description="The colours of the attribute's values",
        items=[(name.upper(), name, "") for name in _COLORMAPS],
        default="VIRIDIS",
    )
    range: FloatVectorProperty(
        name="Range",
        description=(
            "Values of the first and the last colour; if they are equal, the 2nd to 98th "
            "percentile of each frame"
        ),
        size=2,
        default=(0.0, 0.0),
    )
    samples: IntProperty(
        name="Samples",
        description="Rays per pixel",
        default=4,
        min=1,
        max=64,
    )

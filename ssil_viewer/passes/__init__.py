"""The frame: its passes in the order in which they run."""

from ssil_viewer.passes.antialias import Antialias
from ssil_viewer.passes.base import Dispatch, Pass, Read, ScreenPass
from ssil_viewer.passes.composite import Composite
from ssil_viewer.passes.depth_range import DepthRange
from ssil_viewer.passes.direct import Direct
from ssil_viewer.passes.gather import Gather
from ssil_viewer.passes.gbuffer import GBuffer
from ssil_viewer.passes.glossy_gather import GlossyGather
from ssil_viewer.passes.glossy_resolve import GlossyResolve
from ssil_viewer.passes.glossy_upsample import GlossyUpsample
from ssil_viewer.passes.import_gbuffer import ImportGBuffer
from ssil_viewer.passes.mipmap import Mipmap, MipmapBrightest, MipmapRadiance
from ssil_viewer.passes.reflect import AddBounces, Reflect
from ssil_viewer.passes.shadows import ShadowRays, Shadows
from ssil_viewer.passes.sky import Sky, SkyFilter
from ssil_viewer.passes.temporal import Temporal
from ssil_viewer.passes.unseen import UnseenDraw, UnseenGather, UnseenLight, UnseenReflect, UnseenSums
from ssil_viewer.passes.upsample import Upsample
from ssil_viewer.passes.voxel_mipmap import VoxelMipmap
from ssil_viewer.passes.voxelize import Voxelize

FRAME: tuple[type[Pass], ...] = (Shadows, GBuffer, Mipmap, Sky, SkyFilter, ShadowRays, Direct, UnseenLight, UnseenSums,
                                 UnseenDraw, UnseenGather, UnseenReflect, DepthRange, Voxelize, VoxelMipmap, Reflect,
                                 MipmapRadiance, MipmapBrightest, Gather, Upsample, AddBounces, GlossyGather,
                                 GlossyUpsample, GlossyResolve, Temporal, Composite, Antialias)

__all__ = ["FRAME", "AddBounces", "Antialias", "Composite", "DepthRange", "Direct", "Dispatch", "GBuffer", "Gather",
           "GlossyGather", "GlossyResolve", "GlossyUpsample", "ImportGBuffer", "Mipmap", "MipmapBrightest",
           "MipmapRadiance", "Pass", "Read", "Reflect", "ScreenPass", "ShadowRays", "Shadows", "Sky", "SkyFilter",
           "Temporal", "UnseenDraw", "UnseenGather", "UnseenLight", "UnseenReflect", "UnseenSums", "Upsample",
           "VoxelMipmap", "Voxelize"]

"""The extents of an object across and down, and what the image border hides of them. See `box3d` for the conventions.

All that estimation knows about the image border is in this module: which edges of a rectangle it truncates, whether a
rectangle shows only a part of a near person, and how an extent is completed.
"""
from typing import NamedTuple

from ros_3d_bb.camera.images import DepthImage
from ros_3d_bb.core.object_classes import PERSON, ObjectClass
from ros_3d_bb.estimation.box3d import Edges, ImageGeometry, Rect
from ros_3d_bb.estimation.depth_samples import RectSamples

# A box whose edge is this close to the image border, in pixels plus a share of its extent, counts as truncated:
# detectors regress the edge of a truncated person up to 8 pixels inside the image. Measured by ./run bench video, lab:
# without the pixels, the IDF1 of the weight-free detector is 11 % instead of 17 %.
BORDER_PX, BORDER_SHARE = 4, 0.02
# Share of the difference to the usual width that the image border hides on average: people seen from the side are
# narrower. Measured by ./run bench accuracy: RMSE 0.034 m, with 0 0.040 m, with 1 0.044 m.
MISSING_SHARE = 0.6


def truncated_edges(rect_px: Rect, area_px: Rect) -> Edges:
    """Whether the edges of a rectangle touch the border of the area with depth."""
    x1, y1, x2, y2 = rect_px
    left, top, right, bottom = area_px
    across_px, down_px = BORDER_PX + BORDER_SHARE * (x2 - x1), BORDER_PX + BORDER_SHARE * (y2 - y1)
    return Edges(bool(x1 <= left + across_px), bool(y1 <= top + down_px), bool(x2 >= right - across_px),
                 bool(y2 >= bottom - down_px))


class Extent(NamedTuple):
    """What is seen of an extent of an object, metres: from `low_m` to `high_m`. Each end is that of the object, or is
    at the image border.
    """

    low_m: float
    high_m: float
    is_low_cut: bool
    is_high_cut: bool

    @property
    def size_m(self) -> float:
        return self.high_m - self.low_m

    @property
    def middle_m(self) -> float:
        return (self.low_m + self.high_m) / 2

    def completed(self, usual_m: float, share: float = 1.0) -> 'Extent':
        """The extent with a share of what it lacks of the usual one beyond the end that the image border truncates."""
        missing_m = share * max(0.0, usual_m - self.size_m)
        if self.is_low_cut == self.is_high_cut:
            return self
        if self.is_low_cut:
            return self._replace(low_m=self.low_m - missing_m)
        return self._replace(high_m=self.high_m + missing_m)


class ObjectInRect(NamedTuple):
    """A rectangle of a detector, its ObjectClass, its samples, which may be those of a wider rectangle, and the Edges
    of that rectangle."""

    rect_px: Rect
    kind: ObjectClass
    samples: RectSamples
    edges: Edges


def object_in(depth: DepthImage, rect_px: Rect, kind: ObjectClass, geometry: ImageGeometry) -> ObjectInRect:
    """The ObjectInRect of a rectangle: its samples, or those in a wider one of a person whose head is above the image.
    """
    seen = _seen_in(depth, rect_px, kind, geometry)
    if kind.group == PERSON and seen.edges.top:
        wider_px = _widened(seen, depth, geometry)
        if wider_px != rect_px:
            return _seen_in(depth, wider_px, kind, geometry)._replace(rect_px=rect_px)
    return seen


def _seen_in(depth: DepthImage, rect_px: Rect, kind: ObjectClass, geometry: ImageGeometry) -> ObjectInRect:
    """Around people, the edges of a rectangle show mainly what surrounds them, but where the image border truncates
    them; below is the floor, or what hides their legs. Other objects may be as rectangular as a chair.
    """
    edges = truncated_edges(rect_px, geometry.area_px)
    surrounded = [kind.group == PERSON and not is_cut for is_cut in edges[:3]]
    return ObjectInRect(rect_px, kind, RectSamples(depth, rect_px, geometry, surrounded), edges)


def _widened(seen: ObjectInRect, depth: DepthImage, geometry: ImageGeometry) -> Rect:
    """The rectangle of the samples of a person, wider where the body continues beside it, up to the usual width.

    Of people who are so near that their heads are above the image, detectors often find an arm or half of the trunk.
    """
    layer, (left, top, right, bottom) = seen.samples.layer(), seen.rect_px
    usual_px = int(seen.kind.width * geometry.camera.fx * 1000 / layer.trunk_mm) if layer else 0
    missing_px = usual_px - (right - left)
    if layer is None or missing_px <= 0:
        return seen.rect_px
    area_left, _top, area_right, _bottom = geometry.area_px
    around_px = max(left - missing_px, area_left), top, min(right + missing_px, area_right), bottom
    columns = RectSamples(depth, around_px, geometry, ()).columns_of(layer)
    before_px, after_px = max(left - min(columns, default=left), 0), max(max(columns, default=right) - right, 0)
    share = min(missing_px / max(before_px + after_px, 1), 1)
    return left - int(share * before_px), top, right + int(share * after_px), bottom

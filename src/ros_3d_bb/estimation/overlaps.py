"""Occlusion: order of the objects in overlapping rectangles by depth, and masks of what nearer ones show in them."""
from collections import defaultdict
from typing import Dict, List, Sequence, Set, Tuple

from ros_3d_bb.camera.camera_model import Camera
from ros_3d_bb.estimation.body import ObjectInRect
from ros_3d_bb.estimation.depth_samples import BODY_HALF_DEPTH_MM, TRUNK_HALF_DEPTH_MM, UNKNOWN_MM, Layer

# "Views" as in depth_samples.
LEAST_SIZE = 0.65  # of an object relative to its usual size: a chair that is partly hidden appears to have 0.6
# Share of the image height by which nearer people stand lower in the image. Views: p90 0.002 m more without.
CLEARLY_LOWER = 0.02
# Difference of the shares of rectangles beside each other that their layers fill. Views: 3 more without.
CLEARLY_FULLER = 0.2
# Minimum share of the smaller of two rectangles of one object in the other one. Measured by ./run bench video,
# corridor: with 0, the IDF1 of YOLOv5n is 88 % and 2 IDs switch instead of 91 % and 0.
CONTAINED = 0.8


class Overlaps(object):
    """Rectangles of an image, those of nearer objects first; `usable` are the numbers of those with enough depth for an
    estimate."""

    def __init__(self, objects: Sequence[ObjectInRect], usable: Sequence[int], camera: Camera) -> None:
        self._objects, self._camera = objects, camera
        self._areas_px = [(x2 - x1) * (y2 - y1) for x1, y1, x2, y2 in (each.rect_px for each in objects)]
        self.pending = set(usable)  # without an estimate yet
        self._changed = set(usable)  # since the layer was determined
        # Areas that are shared with each pending rectangle that overlaps another one.
        self._shared_px = _shared_areas([objects[number].rect_px + (number,) for number in usable])
        self._nearer: Dict[int, Set[int]] = defaultdict(set)  # pending rectangles of nearer objects that overlap it
        self._layers: Dict[int, Layer] = {}
        self.repeats: Set[int] = set()  # may be of the object of another rectangle

    def take_foremost(self) -> List[int]:
        """Take the pending rectangles that no pending rectangle of a nearer object overlaps. Returns their numbers.

        The nearer of two objects is the one with the nearer layer. If both rectangles show one layer, it belongs to the
        one that it fills more beside the other one. If that does not decide, of two objects of one kind the nearer one
        is clearly lower in the image, or has the nearer layer. Of different kinds, it is the one that is not too small
        for the layer, which may be another object's; otherwise the one that appears smaller, as a person on a couch.
        """
        self._update()
        foremost = [number for number in self.pending if not self._nearer[number]]
        if self.pending and not foremost:  # three or more occlude each other in a circle
            foremost = [max(self.pending,
                            key=lambda number: (self._lowest_px(number), self._areas_px[number], -number))]
        for number in foremost:
            self._remove(number)
        return foremost

    def _lowest_px(self, number: int) -> int:
        return self._objects[number].rect_px[3]

    def _remove(self, number: int) -> None:
        self.pending.remove(number)
        for other in self._shared_px[number]:
            del self._shared_px[other][number]
            self._nearer[other].discard(number)

    def _update(self) -> None:
        """Determine the layers of the pending rectangles that have changed, and their order."""
        changed = sorted(self._changed & self.pending)
        for number in changed:
            layer = self._objects[number].samples.layer()
            if layer is None:  # all is masked
                self._remove(number)
            else:
                self._layers[number] = layer
        for number in self.pending.intersection(changed):
            self._changed.remove(number)
            for other in self._shared_px[number]:
                if other not in self._changed:
                    self._compare(number, other)

    def _compare(self, number: int, other: int) -> None:
        """Determine which of two overlapping rectangles is of the nearer object, and whether it repeats the other."""
        if not self._is_nearer(other, number):
            number, other = other, number
        self._nearer[number].add(other)
        self._nearer[other].discard(number)
        smaller_px = min(self._areas_px[number], self._areas_px[other])
        is_contained = self._shared_px[number][other] >= CONTAINED * smaller_px
        is_same = abs(self._layers[number].trunk_mm - self._layers[other].trunk_mm) < TRUNK_HALF_DEPTH_MM
        if is_contained and is_same and self._are_alike(number, other):
            self.repeats.add(number)

    def _are_alike(self, number: int, other: int) -> bool:
        group = self._objects[number].kind.group
        return bool(group) and group == self._objects[other].kind.group

    def _is_nearer(self, other: int, number: int) -> bool:
        farther_mm = self._layers[number].trunk_mm - self._layers[other].trunk_mm
        if abs(farther_mm) >= TRUNK_HALF_DEPTH_MM:
            return farther_mm > 0
        is_larger = (self._areas_px[other], -other) > (self._areas_px[number], -number)
        if self._are_alike(number, other):
            fuller = self._share_beside(other, number) - self._share_beside(number, other)
            if abs(fuller) > CLEARLY_FULLER:
                return fuller > 0
            lower_px = self._lowest_px(other) - self._lowest_px(number)
            if abs(lower_px) > CLEARLY_LOWER * self._camera.height:
                return lower_px > 0
            return (farther_mm, is_larger) > (0, False)
        is_small, other_is_small = self._is_small(number), self._is_small(other)
        return not is_larger if is_small == other_is_small else is_small

    def _share_beside(self, number: int, other: int) -> float:
        return self._objects[number].samples.share_beside(self._objects[other].rect_px, self._layers[number])

    def _is_small(self, number: int) -> bool:
        each = self._objects[number]
        x1, y1, x2, y2 = each.rect_px
        size_m = max(x2 - x1, y2 - y1) * self._layers[number].trunk_mm / (1000 * self._camera.fy)
        return not any(each.edges) and size_m < LEAST_SIZE * max(each.kind.width, each.kind.height)

    def mask_behind(self, number: int, farthest_mm: int) -> None:
        """Mask what is not farther than `farthest_mm` in the pending rectangles that overlap an estimated one."""
        for other in self.pending.intersection(self._shared_px[number]):
            own_mm = UNKNOWN_MM  # from there on, its own body
            if not self._are_alike(other, number):
                if self._layers[other].trunk_mm - self._layers[number].trunk_mm >= TRUNK_HALF_DEPTH_MM:
                    own_mm = self._layers[other].trunk_mm - BODY_HALF_DEPTH_MM
            if self._objects[other].samples.mask(self._objects[number].rect_px, min(farthest_mm, own_mm)):
                self._changed.add(other)


def _shared_areas(rects_px: Sequence[Tuple[int, ...]]) -> Dict[int, Dict[int, int]]:
    """Areas that rectangles, each with its number, share with each other one, pixels: {number: {other: area}}."""
    by_left = sorted(rects_px)
    shared_px: Dict[int, Dict[int, int]] = defaultdict(dict)
    for rank, (_left, top, right, bottom, number) in enumerate(by_left):
        for other_left, other_top, other_right, other_bottom, other in by_left[rank + 1:]:
            if other_left >= right:
                break
            rows_px = min(bottom, other_bottom) - max(top, other_top)
            if rows_px > 0:
                area_px = (min(right, other_right) - other_left) * rows_px
                shared_px[number][other] = shared_px[other][number] = area_px
    return shared_px

"""Occlusion: order of the objects in overlapping rectangles by depth, and masks of what nearer ones show in them."""
import collections

from ros_3d_bb.estimation.depth_samples import BODY_HALF_DEPTH_MM, LEAST_SIZE, UNKNOWN_MM

# All are chosen; test_difficult_views.py checks them.
CUT_ROWS = 1 / 30.0  # share of the image height at which the lower edges of truncated boxes are compared
SAME_LAYER_M = 0.25  # largest difference of the layers of parts of one body
CLEARLY_NEARER_M = 0.1
CLEARLY_LOWER = 0.02  # share of the image height: nearer people stand lower in the image
CLEARLY_FULLER = 0.2  # difference of the shares of rectangles beside each other that their layers fill
CONTAINED = 0.8  # minimum share of the smaller of two rectangles of one object in the other one


class Overlaps(object):
    """Rectangles of an image, those of nearer objects first.

    Of all `rects_px`, `samples` are the RectSamples, which may be of a wider rectangle, `kinds` the ObjectClasses and
    `truncated` the truncated edges; `usable` are the numbers of those with enough depth for an estimate.
    """

    def __init__(self, rects_px, samples, usable, camera, kinds, truncated):
        self._rects_px, self._samples, self._kinds = rects_px, samples, kinds
        self._clearly_lower_px = CLEARLY_LOWER * camera.height
        self._areas_px, self._lowest_px, self._nearest_m = [], [], []
        for (x1, y1, x2, y2), kind, edges in zip(rects_px, kinds, truncated):
            self._areas_px.append((x2 - x1) * (y2 - y1))
            self._lowest_px.append(min(y2, camera.height * (1 - CUT_ROWS)))
            usual_m = 0 if any(edges) else max(kind.width, kind.height)  # nearer objects would be unusually small
            self._nearest_m.append(LEAST_SIZE * usual_m * camera.fy / max(x2 - x1, y2 - y1, 1))
        self.pending = set(usable)  # without an estimate yet
        self._changed = set(usable)  # since the layer was determined
        self._shared_px = _shared_areas(usable, rects_px)  # with each pending rectangle that overlaps another one
        self._nearer = collections.defaultdict(set)  # pending rectangles of nearer objects that overlap it
        self._layers_m = {}
        self.repeats = set()  # may be of the object of another rectangle

    def take_foremost(self):
        """Take the pending rectangles that no pending rectangle of a nearer object overlaps. Returns their numbers.

        The nearer of two objects is the one with the nearer layer. If both rectangles show one layer, it belongs to the
        one that it fills more beside the other one. If that does not decide, of two objects of one kind the nearer one
        is clearly lower in the image, has a clearly nearer layer or is larger, in this order. Of different kinds, it is
        the one that is not too small for the layer, which may be another object's; otherwise the one that appears
        smaller, as a person on a couch.
        """
        self._update()
        foremost = [number for number in self.pending if not self._nearer[number]]
        if self.pending and not foremost:  # three or more occlude each other in a circle
            foremost = [max(self.pending,
                            key=lambda number: (self._lowest_px[number], self._areas_px[number], -number))]
        for number in foremost:
            self._remove(number)
        return foremost

    def _remove(self, number):
        self.pending.remove(number)
        for other in self._shared_px[number]:
            del self._shared_px[other][number]
            self._nearer[other].discard(number)

    def _update(self):
        """Determine the layers of the pending rectangles that have changed, and their order."""
        changed = sorted(self._changed & self.pending)
        for number in changed:
            layer = self._samples[number].layer()
            if layer is None:  # all is masked
                self._remove(number)
            else:
                self._layers_m[number] = layer.trunk_mm / 1000
        for number in self.pending.intersection(changed):
            self._changed.remove(number)
            for other in self._shared_px[number]:
                if other not in self._changed:
                    self._compare(number, other)

    def _compare(self, number, other):
        """Determine which of two overlapping rectangles is of the nearer object, and whether it repeats the other."""
        if not self._is_nearer(other, number):
            number, other = other, number
        self._nearer[number].add(other)
        self._nearer[other].discard(number)
        smaller_px = min(self._areas_px[number], self._areas_px[other])
        is_contained = self._shared_px[number][other] >= CONTAINED * smaller_px
        is_same = abs(self._layers_m[number] - self._layers_m[other]) < SAME_LAYER_M
        if is_contained and is_same and self._are_alike(number, other):
            self.repeats.add(number)

    def _are_alike(self, number, other):
        group = self._kinds[number].group
        return bool(group) and group == self._kinds[other].group

    def _is_nearer(self, other, number):
        """Whether the other of two objects is nearer."""
        farther_m = self._layers_m[number] - self._layers_m[other]
        if abs(farther_m) >= SAME_LAYER_M:
            return farther_m > 0
        is_larger = (self._areas_px[other], -other) > (self._areas_px[number], -number)
        if self._are_alike(number, other):
            fuller = self._share_beside(other, number) - self._share_beside(number, other)
            if abs(fuller) > CLEARLY_FULLER:
                return fuller > 0
            lower_px = self._lowest_px[other] - self._lowest_px[number]
            if abs(lower_px) > self._clearly_lower_px:
                return lower_px > 0
            return is_larger if abs(farther_m) < CLEARLY_NEARER_M else farther_m > 0
        is_small, other_is_small = (self._layers_m[each] < self._nearest_m[each] for each in (number, other))
        return not is_larger if is_small == other_is_small else is_small

    def _share_beside(self, number, other):
        return self._samples[number].share_beside(self._rects_px[other])

    def mask_behind(self, number, farthest_mm):
        """Mask what is not farther than `farthest_mm` in the pending rectangles that overlap an estimated one."""
        for other in self.pending.intersection(self._shared_px[number]):
            own_mm = UNKNOWN_MM  # from there on, its own body
            if self._layers_m[other] - self._layers_m[number] >= SAME_LAYER_M and not self._are_alike(other, number):
                own_mm = 1000 * self._layers_m[other] - BODY_HALF_DEPTH_MM
            if self._samples[other].mask(self._rects_px[number], min(farthest_mm, own_mm)):
                self._changed.add(other)


def _shared_areas(usable, rects_px):
    """Areas that rectangles share with each other one that they overlap, pixels: {number: {other: area}}."""
    by_left = sorted([rects_px[number] + (number,) for number in usable])
    shared_px = collections.defaultdict(dict)
    for rank, (_left, top, right, bottom, number) in enumerate(by_left):
        for other_left, other_top, other_right, other_bottom, other in by_left[rank + 1:]:
            if other_left >= right:
                break
            rows_px = min(bottom, other_bottom) - max(top, other_top)
            if rows_px > 0:
                area_px = (min(right, other_right) - other_left) * rows_px
                shared_px[number][other] = shared_px[other][number] = area_px
    return shared_px

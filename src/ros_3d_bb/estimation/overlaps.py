"""Order of the objects in overlapping rectangles by their depth, and masks of what nearer objects show in them."""
import numpy as np

from ros_3d_bb.estimation.depth_layers import BODY_HALF_DEPTH_MM, UNKNOWN_MM

# Nearer people stand lower in the image. The lower edges of truncated boxes are compared at this height.
CUT_ROWS = 1 / 30.0  # share of the image height
SAME_LAYER_M = 0.25  # largest difference of the layers of parts of one body
CLEARLY_NEARER_M = 0.1
CLEARLY_LOWER = 0.02  # share of the image height
LEAST_SIZE = 0.65  # minimum share of its usual size that an object appears to have at its layer
LEAST_BESIDE = 0.25  # minimum share of a rectangle beside another one that shows a layer of its own
CONTAINED = 0.8  # minimum share of a second rectangle of an object in the first one
MANY = 200  # from this number of rectangles on, those that few others occlude are foremost, too: for speed
MOST_TIES = 256  # pairs of rectangles whose layers beside each other are determined at once: more than in a crowd


class Overlaps(object):
    """Rectangles of an image, those of nearer objects first.

    Parameters
    ----------
    samples : depth_samples.RectSamples
    usable : numpy.ndarray, (n,)
        Whether rectangles have enough depth for an estimate.
    camera : camera_model.Camera
    kinds : sequence of object_classes.ObjectClass
        That of each rectangle.
    truncated : sequence of (bool, bool, bool, bool)
        Which edges of each rectangle touch the image border.
    """

    def __init__(self, samples, usable, camera, kinds, truncated):
        self._samples, rects_px = samples, samples.rects_px
        self._area_px, self._shared_px = _areas(rects_px)
        self._lowest_px = np.minimum(rects_px[:, 3], camera.height * (1 - CUT_ROWS))
        self._clearly_lower_px = CLEARLY_LOWER * camera.height
        extent_px = np.maximum(rects_px[:, 2:] - rects_px[:, :2], 1).max(axis=1)
        usual_m = np.array([0 if any(edges) else max(kind.width, kind.height)
                            for edges, kind in zip(truncated, kinds)])
        self._nearest_m = LEAST_SIZE * usual_m * camera.fy / extent_px  # nearer objects would be unusually small
        groups = [kind.group for kind in kinds]
        self._alike = np.array([[group is not None and group == other for other in groups] for group in groups])
        self.pending = usable.copy()  # without an estimate yet
        self._changed = usable.copy()  # since the layer was determined
        self._layer_m = np.zeros(len(rects_px))
        # Layers of rectangles beside each other one, or of the whole rectangles where there is no layer beside it
        self._beside_m = np.zeros(self._shared_px.shape)
        self._is_beside = np.zeros(self._shared_px.shape, bool)
        self.repeats = np.zeros(len(rects_px), bool)  # may be of the object of a larger rectangle

    def foremost(self):
        """Numbers of the pending rectangles that no pending rectangle of a nearer object overlaps.

        The nearer of two objects is the one with the nearer layer. A layer that both rectangles show belongs to the one
        that shows it beside the other one, too. If that does not decide, of two objects of one kind the nearer one is
        clearly lower in the image, has a clearly nearer layer or is larger, in this order. Of different kinds, it is
        the one that is not too small for the layer, which may be another object's; otherwise the one that appears
        smaller, as a person on a couch.
        """
        pending = np.flatnonzero(self.pending)
        pairs = np.ix_(pending, pending)
        overlap, alike, area_px = self._shared_px[pairs] > 0, self._alike[pairs], self._area_px[pending]
        self._determine_layers(pending, overlap)
        farther_m = self._beside_m[pairs] - self._beside_m[pairs].T
        lower_px = self._lowest_px[pending] - self._lowest_px[pending][:, None]
        larger = np.where(area_px == area_px[:, None], pending < pending[:, None], area_px > area_px[:, None])
        tied = np.abs(farther_m) < SAME_LAYER_M
        small = self._layer_m[pending] < self._nearest_m[pending]
        unlike_nearer = np.where(small == small[:, None], ~larger, small[:, None])
        nearer = np.where(np.abs(farther_m) < CLEARLY_NEARER_M, larger, farther_m > 0)
        nearer = np.where(np.abs(lower_px) > self._clearly_lower_px, lower_px > 0, nearer)
        nearer = overlap & np.where(tied, np.where(alike, nearer, unlike_nearer), farther_m > 0)
        contained = self._shared_px[pairs] >= CONTAINED * area_px[:, None]
        self.repeats[pending] |= (tied & alike & nearer & contained).any(axis=1)
        in_front = np.count_nonzero(nearer, axis=1)
        if in_front.all():  # three or more occlude each other in a circle
            return pending[[np.lexsort((-area_px, -self._lowest_px[pending]))[0]]]
        return pending[in_front <= len(pending) // MANY]

    def _determine_layers(self, pending, overlap):
        """Determine the layers of pending rectangles (k,) that `overlap` (k, k), if they or the others have changed."""
        changed = self._changed[pending] & overlap.any(axis=1)
        if not changed.any():
            return
        numbers, pairs = pending[changed], np.ix_(pending, pending)
        self._layer_m[numbers] = self._samples.layers(numbers) / 1000
        self._changed[numbers] = False
        layers_m = self._layer_m[pending]
        overlap = overlap & (changed | changed[:, None])
        self._beside_m[pairs] = np.where(overlap, layers_m[:, None], self._beside_m[pairs])
        self._is_beside[pairs] &= ~overlap
        tied = overlap & (np.abs(layers_m - layers_m[:, None]) < SAME_LAYER_M)
        tied &= self._shared_px[pairs] <= (1 - LEAST_BESIDE) * self._area_px[pending][:, None]
        first, second = pending[np.argwhere(tied)[:MOST_TIES].T]
        beside_mm = self._samples.ahead_mm[first]
        for samples_mm, number, other in zip(beside_mm, first.tolist(), second.tolist()):
            self._samples.mask(samples_mm, number, other, UNKNOWN_MM)
        seen = (beside_mm < UNKNOWN_MM).any(axis=1)
        if seen.any():
            self._beside_m[first[seen], second[seen]] = self._samples.layers(first[seen], beside_mm[seen]) / 1000
            self._is_beside[first[seen], second[seen]] = True

    def mask_behind(self, number, farthest_mm):
        """Mask what is not farther than `farthest_mm` in the pending rectangles that overlap an estimated one."""
        for other in np.flatnonzero(self.pending & (self._shared_px[number] > 0)).tolist():
            layer_m = self._beside_m[other, number]
            is_farther = layer_m - self._beside_m[number, other] >= SAME_LAYER_M and (
                self._is_beside[other, number] or not self._alike[other, number])
            own_mm = 1000 * layer_m - BODY_HALF_DEPTH_MM if is_farther else UNKNOWN_MM  # from there on, its own body
            self._samples.mask(self._samples.ahead_mm[other], other, number, min(farthest_mm, own_mm))
            self._changed[other] = True
            self.pending[other] = (self._samples.ahead_mm[other] < UNKNOWN_MM).any()


def _areas(rects_px):
    """Areas (n,) of rectangles (n, 4), and those that they share with each other one (n, n; diagonal: 0), pixels."""
    x1, y1, x2, y2 = rects_px.T
    shared_px = (np.maximum(np.minimum(x2, x2[:, None]) - np.maximum(x1, x1[:, None]), 0)
                 * np.maximum(np.minimum(y2, y2[:, None]) - np.maximum(y1, y1[:, None]), 0))
    area_px = shared_px.diagonal().copy()
    np.fill_diagonal(shared_px, 0)
    return area_px, shared_px

"""Oracle baseline: tracking with perfect data association, and the same maximum track age as our tracker."""
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.tracker import TrackerParams

FORGOTTEN_S = TrackerParams().max_age  # a person without detections for this time gets a new ID
COASTS_S = 1.0


def outputs_with_perfect_association(make_tracker, run):
    """Run a separate tracker for each person, without false detections.

    Returns
    -------
    list of list of TrackedObject
        Published tracks after each image.
    """
    followed, last_number, outputs = {}, 0, []
    for image in run.images:
        found = {source: detection for source, detection in zip(image.sources, image.detections) if source >= 0}
        for person in found:
            if person not in followed or image.stamp_ns - followed[person].seen_ns > FORGOTTEN_S * NS:
                last_number += 1
                followed[person] = _Followed(last_number, make_tracker())
        objects = [followed[person].update(image, found.get(person)) for person in sorted(followed)]
        outputs.append([thing for thing in objects if thing is not None])
    return outputs


class _Followed(object):
    """Person with a track ID and a tracker."""

    def __init__(self, number, tracker):
        self._number, self._tracker, self.seen_ns = number, tracker, None

    def update(self, image, detection):
        """Track of the person as a TrackedObject, or None if the tracker publishes none."""
        if detection is not None:
            self.seen_ns = image.stamp_ns
        elif image.stamp_ns - self.seen_ns > COASTS_S * NS:
            return None
        things = self._tracker.update(image.stamp_ns, [] if detection is None else [detection], image.view)
        newest = max(things, key=lambda thing: thing.last_seen_ns, default=None)
        return newest and newest._replace(id=self._number)

"""What a tracker scores that is told whose each detection is, and remembers people as long as ours."""
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.tracker import TrackerParams

FORGOTTEN_S = TrackerParams().max_age  # who was not found for so long gets another number
COASTS_S = 1.0


def outputs_with_perfect_association(make_tracker, run):
    """What is published after each image of a run if each person has a tracker of their own, without false boxes.

    Returns
    -------
    list of list of TrackedObject
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
    """One person with a number and a tracker."""

    def __init__(self, number, tracker):
        self._number, self._tracker, self.seen_ns = number, tracker, None

    def update(self, image, detection):
        """The person as a TrackedObject, None where the tracker publishes nothing."""
        if detection is not None:
            self.seen_ns = image.stamp_ns
        elif image.stamp_ns - self.seen_ns > COASTS_S * NS:
            return None
        things = self._tracker.update(image.stamp_ns, [] if detection is None else [detection], image.view)
        newest = max(things, key=lambda thing: thing.last_seen_ns, default=None)
        return newest and newest._replace(id=self._number)

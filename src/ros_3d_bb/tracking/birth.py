"""Birth of tracks: detections that start one, and tracks that turn out to be of the object of an older one."""
import itertools
import math

from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.track import MIN_TRACK_SCORE, Track, log_odds_of

# All are chosen; `./run bench tracking` and `./run bench scenes` show the effect of others.
RECENTLY_MATCHED_NS = NS // 2  # no track starts near a track that was matched less than this ago
STARTING_SUPPORT = 0.2  # minimum support of a detection that starts a track: most positions with less are wrong
NEW_NS = 3 * NS // 2  # people pass each other later than that after they were first detected
SAME_PERSON_M = 0.15  # two people who are both visible cannot be this close to each other


def initiate(tracks, unmatched, image, params, rules, assign_id):
    """Start tracks from the unmatched measurements of an image, except those with little support or a low score, and
    duplicate detections of recently matched or new tracks of the same group of classes. Returns the new tracks.

    `params` are `tracker.TrackerParams`, `rules` the `track.Rules`; assign_id(number) returns the ID of the track that
    the detection of this number starts.
    """
    stamp_ns, camera = image.stamp_ns, image.view.camera
    new, occupied = [], [(track.state.x, track.state.y, track.kind.group) for track in tracks
                         if stamp_ns - track.last_ns < RECENTLY_MATCHED_NS]
    for measurement in unmatched:
        detection, kind, x, y = measurement.detection, measurement.kind, measurement.x, measurement.y
        is_likely = log_odds_of(detection.score, rules.even_log_odds) > MIN_TRACK_SCORE
        is_duplicate = any(math.hypot(other_x - x, other_y - y) < params.duplicate_distance and group == kind.group
                           for other_x, other_y, group in occupied)
        if is_likely and detection.support >= STARTING_SUPPORT and not is_duplicate:
            occupied.append((x, y, kind.group))
            new.append(Track(assign_id(measurement.number), measurement, stamp_ns, camera,
                             params.initial_speed * kind.known.initial_speed, rules.even_log_odds))
    return new


def duplicates(tracks, stamp_ns):
    """The IDs of the tracks that are of the object of an older track: both are confirmed, recently matched and at one
    place, and of one group of classes. Tracks that exist for longer than `NEW_NS` are of different objects, which pass
    each other.
    """
    recent = [track for track in tracks if track.is_confirmed and stamp_ns - track.last_ns < RECENTLY_MATCHED_NS]
    if all(stamp_ns - track.first_ns >= NEW_NS for track in recent):
        return set()
    recent.sort(key=lambda track: track.first_ns)
    found, by_x = set(), sorted(enumerate(recent), key=lambda entry: entry[1].state.x)
    for number, (age, track) in enumerate(by_x):
        for other_age, other in itertools.islice(by_x, number + 1, None):
            if other.state.x - track.state.x >= SAME_PERSON_M:
                break
            younger = recent[max(age, other_age)]
            if stamp_ns - younger.first_ns < NEW_NS and _are_same(track, other):
                found.add(younger.id)
    return found


def _are_same(track, other):
    distance_m = math.hypot(track.state.x - other.state.x, track.state.y - other.state.y)
    return distance_m < SAME_PERSON_M and track.kind.group == other.kind.group

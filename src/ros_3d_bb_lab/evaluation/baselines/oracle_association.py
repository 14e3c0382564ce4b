"""Oracle baseline: tracking with perfect data association, and the same maximum track age as our tracker."""
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.tracking.tracker import TrackerParams

FORGOTTEN_S = TrackerParams().max_age  # a person without detections for this time gets a new ID
COASTS_S = 1.0


def outputs_with_perfect_association(make_tracker, run):
    """Run a separate tracker for each person, without false detections. Returns the published tracks of each image."""
    trackers, track_ids, seen_ns, last_id, outputs = {}, {}, {}, 0, []
    for image in run.images:
        found = {source: detection for source, detection in zip(image.sources, image.detections) if source >= 0}
        for person in found:
            if person not in trackers or image.stamp_ns - seen_ns[person] > FORGOTTEN_S * NS:
                last_id += 1
                trackers[person], track_ids[person] = make_tracker(), last_id
            seen_ns[person] = image.stamp_ns
        tracks = []
        for person in sorted(trackers):
            if image.stamp_ns - seen_ns[person] <= COASTS_S * NS:
                detections = [found[person]] if person in found else []
                updated = trackers[person].update(image.stamp_ns, detections, image.view)
                if updated:
                    newest = max(updated, key=lambda track: track.last_seen_ns)
                    tracks.append(newest._replace(id=track_ids[person]))
        outputs.append(tracks)
    return outputs

"""Pictures of what detectors and trackers find in a video, to look at."""
import os

import cv2

from ros_3d_bb.tracking.types import OUT_OF_VIEW, VISIBLE
from ros_3d_bb.visualization.image_overlay import draw_boxes
from ros_3d_bb_lab.evaluation.video.scores import projected

PEOPLE_COLOR = (255, 255, 255)


def write_picture(folder, step, color, people, tracker, view):
    """Write an image to `folder` with the marked people (white) and the tracks.

    Labels are ID, height and distance; of tracks that are not detected, ID and status.
    """
    os.makedirs(folder, exist_ok=True)
    image = color.copy()
    for person in people or ():
        x1, y1, x2, y2 = map(int, person.rect_px)
        cv2.rectangle(image, (x1, y1), (x2, y2), PEOPLE_COLOR, 1)
        cv2.putText(image, '%d: %.1f' % (person.id, person.visible), (x1, y2 - 4), cv2.FONT_HERSHEY_SIMPLEX, 0.5,
                    PEOPLE_COLOR, 1, cv2.LINE_AA)
    tracked = set(track.detection for track in step.tracks[tracker])
    rects, labels = [], []
    for number, rect in step.rects.items():
        if number not in tracked:
            rects.append(rect)
            labels.append('-')
    for track in step.tracks[tracker]:
        rect = step.rects.get(track.detection) or projected(track, view)
        if rect is not None:
            rects.append(rect)
            labels.append(_label(track, view))
    draw_boxes(image, rects, labels)
    cv2.imwrite(os.path.join(folder, step.name + '.jpg'), image[..., ::-1])


def _label(track, view):
    if track.status == VISIBLE:
        return '%d %.2f m, %.1f m' % (track.id, track.size_m[2], view.bearings([track.position_m])[0][0])
    return '%d %s' % (track.id, 'out of view' if track.status == OUT_OF_VIEW else 'not detected')

"""Report on the tracks in a bag: a picture and a table, also as an HTML file that contains both. Of a simulated scene,
the table compares the tracks with truth.
"""
import argparse
import csv
import io
import os
import pathlib
import sys
from typing import NamedTuple

import matplotlib
import numpy as np
import rosbag

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC, absolute, topic_of
from ros_3d_bb.conversions.image_msgs import imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import (BOXES3D_TOPIC, BOXES_TOPIC, TRACKS_TOPIC, boxes2d_from_msg, stamp_of,
                                                   tracks_from_msg, transform_from_msg)
from ros_3d_bb.core.atomic_file import atomic_write, check_writable
from ros_3d_bb.core.time_sync import NS, half_period_of
from ros_3d_bb.tracking.types import VISIBLE
from ros_3d_bb.visualization.image_overlay import draw_boxes, draw_caption
from ros_3d_bb_lab.evaluation.clear_mot import Moment, score, table_of_people
from ros_3d_bb_lab.evaluation.html_report import figure, html_report, paragraph, table
from ros_3d_bb_lab.evaluation.text_table import lines_of
from ros_3d_bb_lab.simulation.ros.scenario_to_bag import BASE_FRAME, MAP_FRAME, ODOM_FRAME, TRUTH_TOPIC

matplotlib.use('Agg')
from matplotlib import gridspec, pyplot  # noqa: E402 (the backend must be selected first)

PANELS, COLUMNS = 6, 3
SIZE_IN, LINE_IN, DPI = (14.56, 14.5), 0.17, 100
CSV_COLUMNS = ('stamp_s', 'id', 'label', 'status', 'x_m', 'y_m', 'vx_mps', 'vy_mps', 'var_x_m2', 'cov_xy_m2',
               'var_y_m2')
TRUTH_COLOR, ROBOT_COLOR = '#aaaaaa', '#141414'
LEGEND = ('Map: the colours are visible tracks with their IDs, grey are the true paths of people, black is the robot. '
          'A track ID is not the number of a person: it only has to stay the same. ')
TRUTH_LEGEND = ('Table: for each person, how long the person was in view, the shares of this time with a visible track '
                'and with a track of any status, the changes of the track ID, the IDs, and the position error of '
                'visible tracks, RMS and largest. ')
SEE_ALSO = 'The pages Bags and Troubleshooting of the documentation, and rosrun ros_3d_bb doctor BAG, help further.'


class Recording(NamedTuple):
    moments: list      # a Moment per image, without tracks if the tracker did not publish a message for the image
    has_truth: bool    # whether the bag contains ground truth
    answered: int      # number of images for which the tracker published a message
    boxes: dict        # 2D boxes (n, 4) by stamp
    robot: np.ndarray  # path of the robot in the map, (n, 2)
    cameras: int       # number of cameras, whose images are different moments


def read_recording(bag):
    """Read a Recording from an open bag. Raises ValueError if tracks are missing, or the frames of truth differ."""
    truth, tracks, boxes, links, robot = {}, {}, {}, {}, []
    boxes_topics = topics_of_cameras(bag, BOXES_TOPIC)
    truth_topic, tracks_topic = topics_of_robot(bag)
    for topic, message in messages_on(bag, [truth_topic, tracks_topic, '/tf'] + boxes_topics):
        if topic == '/tf':
            links.update({(link.header.frame_id, link.child_frame_id): transform_from_msg(link)
                          for link in message.transforms})
            if {(MAP_FRAME, ODOM_FRAME), (ODOM_FRAME, BASE_FRAME)} <= set(links):
                robot.append(links[MAP_FRAME, ODOM_FRAME].dot(links[ODOM_FRAME, BASE_FRAME])[:2, 3])
        elif topic in boxes_topics:
            boxes2d = boxes2d_from_msg(message)
            boxes[boxes2d.stamp_ns] = boxes2d.boxes
        else:
            by_stamp = truth if topic == truth_topic else tracks
            by_stamp[stamp_of(message)] = message
    if not tracks:
        reason = ('but 3D boxes: probably tf lacks the pose of the camera; rosrun ros_3d_bb doctor checks it'
                  if topics_of_cameras(bag, BOXES3D_TOPIC) else
                  'a recorded run of simulation.launch, or a result of process_bag expected, in which rosrun ros_3d_bb '
                  'doctor finds the cause')
        raise ValueError('the bag has no messages on /%s; %s' % (TRACKS_TOPIC, reason))
    frames = set(message.header.frame_id for by_stamp in (truth, tracks) for message in by_stamp.values())
    if len(frames) > 1:
        raise ValueError('truth and tracks have the frames %s; one frame expected' % ', '.join(sorted(frames)))
    of_image = _tracks_of_images(sorted(truth), tracks) if truth else tracks
    moments = [Moment(stamp_ns, tracks_from_msg(truth[stamp_ns]) if truth else [],
                      tracks_from_msg(of_image[stamp_ns]) if stamp_ns in of_image else [])
               for stamp_ns in sorted(truth or tracks)]
    answered = len(of_image)
    return Recording(moments, bool(truth), answered, boxes, np.array(robot).reshape(-1, 2),
                     max(1, len(topics_of_cameras(bag, COLOR_TOPIC)), len(boxes_topics)))


def _tracks_of_images(stamps_ns, tracks):
    """Return {stamp of an image: message of tracks}, given the messages by their stamps: those of depth images, which
    may be within half a period of that of colour, as for `time_sync.StampSynchronizer`. Each message is used once."""
    of_image = {stamp_ns: tracks[stamp_ns] for stamp_ns in stamps_ns if stamp_ns in tracks}
    others, tolerance_ns = set(tracks) - set(of_image), half_period_of(stamps_ns)
    for stamp_ns in sorted(set(stamps_ns) - set(of_image)):
        nearest_ns = min(others, key=lambda other_ns: abs(other_ns - stamp_ns), default=None)
        if nearest_ns is not None and abs(nearest_ns - stamp_ns) <= tolerance_ns:
            of_image[stamp_ns] = tracks[nearest_ns]
            others.remove(nearest_ns)
    return of_image


def table_of_tracks(moments):
    """Format the times for which the tracks of a list of Moment are visible, as `clear_mot.table_of_people`."""
    stamps = {}
    for moment in moments:
        for track in moment.tracks:
            if track.status == VISIBLE:
                stamps.setdefault(track.id, []).append(moment.stamp_ns)
    first_ns = moments[0].stamp_ns
    rows = [('%d' % number, '%d' % len(seen), '%.1f s' % ((seen[0] - first_ns) / NS),
             '%.1f s' % ((seen[-1] - first_ns) / NS)) for number, seen in sorted(stamps.items())]
    return ('track', 'images', 'first seen', 'last seen'), rows, 'number of tracks: %d' % len(rows)


def write_csv(bag_path, csv_path):
    """Write each track of each image in a bag as a row of CSV_COLUMNS; covariances are empty if unknown."""
    text = io.StringIO()
    rows = csv.writer(text)
    rows.writerow(CSV_COLUMNS)
    with rosbag.Bag(bag_path) as bag:
        for _topic, message in messages_on(bag, topics_of_robot(bag)[1:]):
            stamp = '%d.%09d' % (message.header.stamp.secs, message.header.stamp.nsecs)
            for track in tracks_from_msg(message):
                covariance = [''] * 3 if track.covariance is None else track.covariance[[0, 0, 1], [0, 1, 1]]
                rows.writerow([stamp, track.id, track.label, track.status, *track.position_m[:2],
                               *track.velocity_mps[:2], *covariance])
    atomic_write(csv_path, text.getvalue().encode())


def topics_of_cameras(bag, topic):
    ending = topic_of('?', topic)[1:]
    names = map(absolute, bag.get_type_and_topic_info().topics)
    return [name for name in names if name.endswith(ending)]


def topics_of_robot(bag):
    """Names of ground truth and tracks in an open bag, in the namespace of the tracks if there is only one."""
    names = topics_of_cameras(bag, TRACKS_TOPIC)
    namespace = names[0][:-len('/' + TRACKS_TOPIC)] if len(names) == 1 else ''
    return ['%s/%s' % (namespace, topic) for topic in (TRUTH_TOPIC, TRACKS_TOPIC)]


def messages_on(bag, topics):
    """Yield (topic, message) on topics with a leading slash, which `rosbag record` stores with or without, as given."""
    names = [name for name in bag.get_type_and_topic_info().topics if absolute(name) in topics]
    for name, message, _time in bag.read_messages(names) if names else ():  # rosbag reads all topics for []
        yield absolute(name), message


def paths_of(recording):
    """Paths of people and visible tracks in the map by ID."""
    people, tracks = {}, {}
    for moment in recording.moments:
        for person in moment.truth:
            people.setdefault(person.id, []).append(person.position_m[:2])
        for track in moment.tracks:
            if track.status == VISIBLE:
                tracks.setdefault(track.id, []).append(track.position_m[:2])
    return people, tracks


def panels_of(bag, recording, color_topic=''):
    """Colour images at regular intervals with their 2D boxes. Images with a message of 2D boxes are preferred.

    `color_topic` is the name of colour in the bag, if it is not that of the nodes.
    """
    stamps = [moment.stamp_ns for moment in recording.moments]
    stamps = [stamp_ns for stamp_ns in stamps if stamp_ns in recording.boxes] or stamps
    wanted = set(stamps[pick] for pick in np.linspace(0, len(stamps) - 1, PANELS + 2)[1:-1].astype(int))
    panels = []
    topics = [absolute(color_topic)] if color_topic else topics_of_cameras(bag, COLOR_TOPIC)
    for _topic, message in messages_on(bag, topics):
        stamp_ns = message.header.stamp.to_nsec()
        if stamp_ns in wanted:
            boxes = recording.boxes.get(stamp_ns, np.zeros((0, 4), int))
            panel = draw_boxes(imgmsg_to_rgb(message).copy(), boxes, [''] * len(boxes))
            panels.append(draw_caption(panel, '%.1f s' % ((stamp_ns - recording.moments[0].stamp_ns) / NS)))
    return panels


def why_empty(recording):
    """Return why the map of a recording shows no tracks, as a sentence; empty if it shows some."""
    if any(track.status == VISIBLE for moment in recording.moments for track in moment.tracks):
        return ''
    count = sum(map(len, recording.boxes.values()))
    if not count:
        return 'no tracks: no people were detected (no 2D boxes in the bag)'
    return 'no tracks: %d 2D boxes, none of which was tracked: without depth, or in too few images' % count


def draw_scene(path, panels, people, tracks, robot, lines):
    """Write the image of a scene: panels (h, w, 3), uint8 RGB, a top view of the paths in the map, and lines of text.

    `people` and `tracks` are paths {ID: (n, 2)} and `robot` is a path (n, 2) in metres. The suffix of the file selects
    its format.
    """
    rows = (len(panels) + COLUMNS - 1) // COLUMNS
    text_share = LINE_IN * (len(lines) + 3) / SIZE_IN[1]  # with the labels of the axis
    grid = gridspec.GridSpec(rows + 1, COLUMNS, height_ratios=[1] * rows + [1.8], left=0.04, right=0.99, top=0.99,
                             bottom=text_share, wspace=0.02, hspace=0.08)
    figure = pyplot.figure(figsize=SIZE_IN, dpi=DPI)
    for number, panel in enumerate(panels):
        axes = figure.add_subplot(grid[divmod(number, COLUMNS)])
        axes.imshow(panel)
        axes.set_axis_off()
    _draw_paths(figure.add_subplot(grid[rows, :]), people, tracks, robot)
    figure.text(0.03, 0.01, '\n'.join(lines), family='monospace')
    figure.savefig(path, dpi=DPI)
    pyplot.close(figure)


def _draw_paths(axes, people, tracks, robot):
    for number, path in sorted(people.items()):
        axes.plot(*zip(*path), color=TRUTH_COLOR, linewidth=6)
        axes.annotate('person %d' % number, path[-1], (6, -12), textcoords='offset points')
    for number, path in sorted(tracks.items()):
        line, = axes.plot(*zip(*path))
        axes.annotate(str(number), path[0], (-4, 6), textcoords='offset points', color=line.get_color(), weight='bold',
                      bbox={'boxstyle': 'round', 'facecolor': 'white', 'edgecolor': line.get_color()}, zorder=9)
    axes.plot(robot[:, 0], robot[:, 1], color=ROBOT_COLOR, marker='o', markevery=[-1] if len(robot) else [])
    axes.set_aspect('equal', 'datalim')
    axes.grid(True)
    axes.set(title='map in metres: %stracks with their IDs (colour)%s' % (
        'true paths (grey), ' if people else '', ', robot (black)' if len(robot) else ''))


def write_report(bag_path, picture_path, color_topic=''):
    """Write the picture, and the report beside it as HTML. Returns the table, a list of lines. Raises ValueError or
    OSError.
    """
    with rosbag.Bag(bag_path) as bag:
        recording = read_recording(bag)
        header, rows, summary = (table_of_people(score(recording.moments, recording.cameras)) if recording.has_truth
                                 else table_of_tracks(recording.moments))
        summary = '; '.join(filter(None, (summary, '%d of %d images answered' % (
            recording.answered, len(recording.moments)), why_empty(recording))))
        lines = lines_of(header, rows) + [summary]
        people, tracks = paths_of(recording)
        draw_scene(picture_path, panels_of(bag, recording, color_topic), people, tracks, recording.robot, lines)
    picture = pathlib.Path(picture_path)
    elements = (figure(picture, 'Images with 2D boxes, and paths in the map'), paragraph(summary + '.'),
                paragraph(LEGEND + (TRUTH_LEGEND if recording.has_truth else '') + SEE_ALSO),
                table('People and their tracks' if recording.has_truth else 'Tracks', header, rows))
    page = html_report('Tracks in %s' % os.path.basename(bag_path), elements)
    picture.with_suffix('.html').write_text(page, encoding='utf-8')
    return lines


def main():
    """Run the command `scene_report`."""
    parser = argparse.ArgumentParser(prog='scene_report', description=__doc__)
    parser.add_argument('bag', help='bag with ros_3d_bb/tracks')
    parser.add_argument('picture', nargs='?', help='image file to write (default: the name of the bag with .png)')
    parser.add_argument('--color-topic', default='', metavar='TOPIC',
                        help='colour images in the bag, if their topic is not %s' % COLOR_TOPIC)
    parser.add_argument('--csv', default='', metavar='FILE', help='also write the tracks to this CSV file')
    arguments = parser.parse_args()
    picture = arguments.picture or os.path.splitext(arguments.bag)[0] + '.png'
    picture += '' if os.path.splitext(picture)[1] else '.png'
    output = 'report'
    try:
        for path in filter(None, (picture, arguments.csv)):
            check_writable(path)
        lines = write_report(arguments.bag, picture, arguments.color_topic)
        if arguments.csv:
            output = 'table'
            write_csv(arguments.bag, arguments.csv)
            lines.append('table: %s' % arguments.csv)
    except rosbag.ROSBagUnindexedException:
        sys.exit('scene_report: %s has no index, because its recording was interrupted; repair it with: rosbag '
                 'reindex; no report was written' % arguments.bag)
    except (ValueError, OSError, rosbag.ROSBagException) as error:
        sys.exit('scene_report: %s: %s; no %s was written' % (arguments.bag, error, output))
    print('\n'.join(lines + ['picture: %s' % picture, 'report: %s.html' % os.path.splitext(picture)[0]]))

"""Make doc/images/demo.gif, the camera image of the demo beside the tracks in RViz, and rviz.png, RViz explained.

All people are simulated.

xvfb-run -a -s '-screen 0 960x720x24' python3 doc/demo_pictures.py doc/images (or ./run pictures)
"""
import contextlib
import os
import subprocess
import sys
import tempfile
import time

import matplotlib
import numpy as np
import rosbag
import rosgraph
import rospy
import yaml
from PIL import Image
from PyQt5 import QtGui
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

from ros_3d_bb.conversions.camera_msgs import COLOR_TOPIC
from ros_3d_bb.conversions.image_msgs import imgmsg_to_rgb
from ros_3d_bb.conversions.perception_msgs import BOXES_TOPIC, boxes2d_from_msg
from ros_3d_bb.visualization.image_overlay import draw_boxes
from ros_3d_bb_lab.evaluation.launching import free_port

matplotlib.use('Agg')
from matplotlib import pyplot  # noqa: E402 (the backend must be selected first)

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
MARKERS = 'visualization_marker_array'
FIRST_S, LAST_S = 1.0, 8.0
EVERY = 2               # of the images, 15 a second
EXPLAINED = 48          # number of the image that is explained: a person is hidden
# Namespace, track ID and point of a marker, its explanation, and where that is in the picture.
EXPLANATIONS = (
    ('cylinder', 1, None, 'cylinder: position,\nwidth and height', (120, 190)),
    ('id', 2, None, 'track ID; grey with ?:\nhidden or out of view', (850, 40)),
    ('ellipse', 4, 0, 'ellipse: contains the position\nwith 95 % probability', (170, 480)),
    ('velocity', 3, 1, 'velocity: after 1 s', (770, 210)),
    ('prediction', 3, 1, 'prediction: after 2 s', (850, 370)),
    ('history', 4, 0, 'history: the last 4 s', (640, 490)))
EXPLAINED_HEIGHT_PX = 540
RVIZ_PX = 960, 720      # the whole screen
PANEL_PX = 480, 360
RVIZ_DELAY_S = 0.4      # until RViz has drawn new markers
CAMERA_COLORS, RVIZ_COLORS = 72, 120
DPI, COLORS = 100, 128
SAME_LEVELS = 10, 2  # pixels of camera and RViz that change less keep their colour
FOCUS_M, DISTANCE_M, PITCH, YAW = (3.2, 0.1, 0.5), 6.0, 0.55, 3.4
FIELD_OF_VIEW = np.radians(45)  # of RViz, vertical


def write_bag(folder):
    """Simulate the demo, process it, and return the path of the bag."""
    scene, result = os.path.join(folder, 'scene.bag'), os.path.join(folder, 'result.bag')
    subprocess.check_call(['rosrun', 'ros_3d_bb', 'scenario_to_bag',
                           os.path.join(ROOT, 'config', 'scenarios', 'demo.yaml'), scene])
    subprocess.check_call(['rosrun', 'ros_3d_bb', 'process_bag', scene, result, '--detector', 'depth', '--error-model',
                           os.path.join(ROOT, 'config', 'error_models', 'simulated_d435i.yaml')])
    return result


def write_rviz_config(path):
    """The configuration of the package without its panels, in a window of the size of the picture."""
    with open(os.path.join(ROOT, 'rviz', 'pipeline.rviz')) as stream:
        config = yaml.safe_load(stream)
    manager = config['Visualization Manager']
    manager['Displays'] = [display for display in manager['Displays'] if display['Name'] in ('Tracks', 'Grid')]
    manager['Views'] = {'Current': {
        'Class': 'rviz/Orbit', 'Target Frame': '<Fixed Frame>', 'Distance': DISTANCE_M, 'Pitch': PITCH, 'Yaw': YAW,
        'Focal Point': dict(zip('XYZ', FOCUS_M))}}
    config['Panels'] = []
    config['Window Geometry'] = {'X': 0, 'Y': 0, 'Width': RVIZ_PX[0], 'Height': RVIZ_PX[1],
                                 'Hide Left Dock': True, 'Hide Right Dock': True}
    with open(path, 'w') as stream:
        yaml.safe_dump(config, stream)


@contextlib.contextmanager
def process(*command):
    """Context in which a program runs."""
    running = subprocess.Popen(command)
    try:
        yield running
    finally:
        running.terminate()
        running.wait()


def moments_of(bag):
    """(time, colour image with its boxes, markers) of each image of an open bag."""
    boxes, markers, images = {}, {}, {}
    for topic, message, stamp in bag.read_messages(['/' + name for name in (BOXES_TOPIC, MARKERS, COLOR_TOPIC)]):
        if topic == '/' + COLOR_TOPIC:
            images[stamp] = imgmsg_to_rgb(message)
        elif topic == '/' + MARKERS:
            markers[stamp] = message
        else:
            boxes[stamp] = boxes2d_from_msg(message).boxes
    for stamp in sorted(images):
        yield stamp, draw_boxes(images[stamp].copy(), boxes[stamp], [''] * len(boxes[stamp])), markers[stamp]


def grab():
    """The screen, (height, width, 3), uint8 RGB."""
    image = QtGui.QGuiApplication.primaryScreen().grabWindow(0).toImage().convertToFormat(QtGui.QImage.Format_RGB888)
    pixels = np.frombuffer(image.constBits().asarray(image.byteCount()), np.uint8)
    return pixels.reshape(image.height(), image.bytesPerLine())[:, :3 * image.width()].reshape(
        image.height(), image.width(), 3).copy()


def frames_of(moments):
    """Show moments in RViz. Returns the frames of the animation, and RViz with the moment that is explained."""
    clock = rospy.Publisher('clock', Clock, queue_size=10)
    publisher = rospy.Publisher(MARKERS, MarkerArray, queue_size=10)
    while not publisher.get_num_connections():
        time.sleep(0.1)
    frames, explained, start = [], None, moments[0][0]
    for number, (stamp, image, markers) in enumerate(moments):
        clock.publish(Clock(clock=stamp))
        publisher.publish(markers)
        if number % EVERY == 0 and FIRST_S <= (stamp - start).to_sec() <= LAST_S:
            time.sleep(RVIZ_DELAY_S)
            shown = grab()
            frames.append(np.hstack([np.asarray(Image.fromarray(panel).resize(PANEL_PX, Image.LANCZOS))
                                     for panel in (image, shown)]))
            explained = shown if number == EXPLAINED else explained
        else:
            time.sleep(0.02)
    return frames, explained


def _colors_of(pixels, count, method):
    return Image.fromarray(np.ascontiguousarray(pixels)).quantize(count, method, kmeans=2).getpalette()[:3 * count]


def write_gif(frames, path, period_s):
    """Write an animation with one palette, in which pixels that hardly change are transparent."""
    sample, transparent = np.vstack(frames[::len(frames) // 6]), CAMERA_COLORS + RVIZ_COLORS
    palette = Image.new('P', (1, 1))
    palette.putpalette(
        _colors_of(sample[:, :PANEL_PX[0]], CAMERA_COLORS, Image.MEDIANCUT)
        + _colors_of(sample[:, PANEL_PX[0]:], RVIZ_COLORS, Image.MAXCOVERAGE))
    same_levels = np.repeat(SAME_LEVELS, (PANEL_PX[0],) * 2)
    pictures, shown = [], None
    for frame in frames:
        indices = np.array(Image.fromarray(frame).quantize(palette=palette, dither=Image.NONE))
        if shown is None:
            shown = frame.astype(int)
        else:
            same = np.abs(frame - shown).max(axis=2) <= same_levels
            shown[~same] = frame[~same]
            indices[same] = transparent
        picture = Image.fromarray(indices, 'P')
        picture.putpalette(palette.getpalette())
        pictures.append(picture)
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=int(1000 * period_s), loop=0,
                     transparency=transparent, disposal=1, optimize=False)


def pixel_of(point_m):
    """The pixel of RViz that shows a point of the map."""
    to_focus = -np.array([np.cos(PITCH) * np.cos(YAW), np.cos(PITCH) * np.sin(YAW), np.sin(PITCH)])
    right = np.cross(to_focus, [0, 0, 1]) / np.cos(PITCH)
    offset = np.subtract(point_m, FOCUS_M) + DISTANCE_M * to_focus
    focal_px = RVIZ_PX[1] / 2 / np.tan(FIELD_OF_VIEW / 2)
    x, y, depth = right.dot(offset), np.cross(to_focus, right).dot(offset), to_focus.dot(offset)
    return RVIZ_PX[0] / 2 + focal_px * x / depth, RVIZ_PX[1] / 2 + focal_px * y / depth


def write_explained(picture, markers, path):
    """Write a picture of RViz with the meaning of its markers."""
    figure = pyplot.figure(figsize=(RVIZ_PX[0] / DPI, EXPLAINED_HEIGHT_PX / DPI), dpi=DPI)
    axes = figure.add_axes([0, 0, 1, 1])
    axes.imshow(picture[:EXPLAINED_HEIGHT_PX])
    axes.set_axis_off()
    by_name = {(marker.ns, marker.id): marker for marker in markers}
    for namespace, number, point, text, place in EXPLANATIONS:
        marker = by_name[namespace, number]
        position = marker.pose.position
        offset = marker.points[point] if point is not None else None
        target = [getattr(position, axis) + (getattr(offset, axis) if offset else 0) for axis in 'xyz']
        axes.annotate(text, pixel_of(target), place, color='white', ha='center', va='center', fontsize=11,
                      arrowprops={'arrowstyle': '->', 'color': 'white'})
    figure.savefig(path, dpi=DPI)
    image = Image.open(path).convert('RGB').quantize(COLORS, Image.MEDIANCUT, dither=Image.NONE)
    image.save(path, optimize=True)


def main(folder):
    """Make the pictures."""
    with tempfile.TemporaryDirectory() as place, contextlib.ExitStack() as stack:
        bag, config = write_bag(place), os.path.join(place, 'pictures.rviz')
        write_rviz_config(config)
        port = free_port()
        os.environ['ROS_MASTER_URI'] = 'http://localhost:%d' % port
        stack.enter_context(process('roscore', '-p', str(port)))
        while not rosgraph.is_master_online():
            time.sleep(0.1)
        application = QtGui.QGuiApplication([])
        rospy.init_node('demo_pictures')
        rospy.set_param('/use_sim_time', True)
        stack.enter_context(process('rviz', '-d', config, '--splash-screen', '', '--fullscreen'))
        with rosbag.Bag(bag) as opened:
            moments = list(moments_of(opened))
        frames, explained = frames_of(moments)
        write_gif(frames, os.path.join(folder, 'demo.gif'), EVERY / 15.0)
        write_explained(explained, moments[EXPLAINED][2].markers, os.path.join(folder, 'rviz.png'))
        application.quit()


if __name__ == '__main__':
    main(sys.argv[1])

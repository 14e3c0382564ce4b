"""Command `process_bag`: run the pipeline on a bag without a ROS master."""
import argparse
import math
import os
import sys
from typing import Any, Callable, Dict, Iterable, List, Optional, Tuple

import yaml

from ros_3d_bb.bags.bag_pipeline import NOT_KEPT, process_bag
from ros_3d_bb.bags.bag_reader import BagError
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS, STATIC_TOPIC, TF_TOPIC
from ros_3d_bb.core.atomic_file import clean_up_on_sigterm
from ros_3d_bb.core.error_text import cause
from ros_3d_bb.core.event_counter import EventCounter
from ros_3d_bb.core.params import IMAGE_ROTATION, nearest_name, params_from, with_places
from ros_3d_bb.core.yaml_loader import load_yaml
from ros_3d_bb.estimation.box3d import REASONS
from ros_3d_bb.pipeline.camera_pose import FLOOR, POSE_FITTED
from ros_3d_bb.pipeline.detectors import DETECTORS, NONE, check_weights
from ros_3d_bb.pipeline.people_pipeline import INPUTS, OUTPUTS, OUTPUTS_OF_CAMERA, TRACKED, Settings

HIGHEST_M = 100.0
IMAGE_NODES = 'detection', 'bbox3d'
FILES = (('--detector-params', 'detection'), ('--bbox3d-params', 'bbox3d'), ('--tracker-params', 'tracker'))
# Parameters with an option.
OPTIONS = 'detector', 'weights', 'error_model', 'target_frame', 'cameras', 'depth', 'image_rotation'


def main(arguments: Optional[List[str]] = None) -> None:
    """Run the command. The exit status is 1 if the bag could not be processed, or no image was tracked."""
    parser = _parser()
    given = parser.parse_args(arguments)
    try:
        if os.path.realpath(given.source) == os.path.realpath(given.target):
            raise ValueError('the output %s is also the input; choose another output' % given.target)
        if given.searches < 0:
            raise ValueError('--searches is %d; 0 or more expected' % given.searches)
        settings = _settings_from(given)
    except (ValueError, OSError, yaml.YAMLError) as error:
        parser.error(with_places(str(error), _option_named))
    clean_up_on_sigterm()
    try:
        events = process_bag(given.source, given.target, settings)
    except KeyboardInterrupt:
        print('process_bag: interrupted; the incomplete bag was removed', file=sys.stderr)
        sys.exit(130)
    except Exception as error:  # a damaged bag can raise any exception
        print('%s; no bag was written' % _reason(given.source, settings, error), file=sys.stderr)
        sys.exit(1)
    print('\n'.join(['%s:' % given.target] + _summary(events, settings)))
    sys.exit(0 if events.counts.get('images tracked') else 1)


def _settings_from(given: argparse.Namespace) -> Settings:
    settings = Settings()._replace(detector=given.detector, names=_names(given.remap), compression=given.compression,
                                   keep=None if given.keep is None else tuple(t.lstrip('/') for t in given.keep))
    for option, node in FILES:
        path = getattr(given, option[2:].replace('-', '_'))
        try:
            parts: Any = read_params(path, params_of(settings, node))
            settings = settings._replace(**{node: parts})
        except (ValueError, OSError, yaml.YAMLError) as error:
            raise ValueError('%s: %s' % (option, error))
    cameras = given.cameras and [name.strip() for name in given.cameras.split(',')]
    for node, name, value in (('detection', 'detector', given.detector), ('detection', 'weights', given.weights),
                              ('bbox3d', 'error_model', given.error_model),
                              ('tracker', 'error_model', given.error_model),
                              ('tracker', 'target_frame', given.target_frame), ('tracker', 'cameras', cameras)):
        if value:
            settings = with_params(settings, node, **{name: value})
    for node in ('detection', 'bbox3d', 'tracker'):  # one kind of depth images for all
        settings = with_params(settings, node, depth=given.depth or settings.bbox3d[0].depth)
    settings = _with_camera(settings, given)
    _check_names(settings)
    if settings.detector != NONE:
        check_weights(settings.detection[0])
    return settings._replace(searches=given.searches or len(os.sched_getaffinity(0)))


def _check_names(settings: Settings) -> None:
    """Raise ValueError if a remapped topic is not one of the nodes with these cameras and this kind of depth."""
    unmapped = settings._replace(names={})
    topics = [unmapped.name(topic)[1:] for topic in OUTPUTS + (TF_TOPIC, STATIC_TOPIC)] + [
        unmapped.name(topic, name)[1:] for name in settings.camera_names
        for topic in set(INPUTS).union(OUTPUTS_OF_CAMERA) - {TF_TOPIC, STATIC_TOPIC}]
    for ours, theirs in settings.names.items():
        if ours not in topics:
            raise ValueError('--remap %s:=%s: the nodes have no topic %s; did you mean %s?'
                             % (ours, theirs, ours, nearest_name(ours, topics)))


def _with_camera(settings: Settings, given: argparse.Namespace) -> Settings:
    if given.image_rotation:
        for node in IMAGE_NODES:
            settings = with_params(settings, node, image_rotation=given.image_rotation)
    if given.camera_height is None:
        for option, value in (('--camera-tilt', given.camera_tilt), ('--camera-roll', given.camera_roll)):
            if value:
                raise ValueError('%s is given without --camera-height; both expected, or neither' % option)
    if given.camera_height is None and given.camera_pose is None:
        return settings
    if given.camera_height is not None and given.camera_pose is not None:
        raise ValueError('--camera-height and --camera-pose are given; one of them expected')
    tracker, option = settings.tracker[0], '--camera-pose' if given.camera_height is None else '--camera-height'
    if tracker.cameras:
        raise ValueError('%s is given with several cameras; expected with a single camera only' % option)
    for node in IMAGE_NODES:
        settings = with_params(settings, node, floor_frame=tracker.target_frame)
    settings = with_params(settings, 'detection', floor_height=0.0)
    return settings._replace(camera_pose=given.camera_pose or _given_pose(given))


def _given_pose(given: argparse.Namespace) -> Tuple[float, float, float]:
    if not (0 < given.camera_height < HIGHEST_M and abs(given.camera_tilt) < math.pi / 2):
        raise ValueError('--camera-height is %g and --camera-tilt %g; more than 0 and less than %g m, and less than '
                         'pi / 2 rad expected' % (given.camera_height, given.camera_tilt, HIGHEST_M))
    if not abs(given.camera_roll) < math.pi / 4:
        raise ValueError('--camera-roll is %g; less than pi / 4 rad expected, and --image-rotation for quarter turns'
                         % given.camera_roll)
    return given.camera_height, given.camera_tilt, given.camera_roll


def params_of(settings: Settings, node: str) -> Tuple[Any, ...]:
    return settings.detector_params if node == 'detection' else getattr(settings, node)


def with_params(settings: Settings, node: str, **changed: Any) -> Settings:
    first, *others = params_of(settings, node)
    parts: Any = (first._replace(**changed), *others)
    return settings._replace(**{node: parts})


def read_params(path: Optional[str], defaults: Tuple[Any, ...]) -> Tuple[Any, ...]:
    """Read the parameters of a node from a YAML file; missing parameters are taken from `defaults`."""
    if path is None:
        return defaults
    with open(path) as stream:
        content = load_yaml(stream) or {}
    if not (isinstance(content, dict) and all(isinstance(key, str) for key in content)):
        raise ValueError('%s: names and values of parameters expected' % path)
    try:
        found = params_from(content, *[type(part) for part in defaults])
    except ValueError as error:
        raise ValueError('%s: %s' % (path, error))
    return tuple(part._replace(**{key: getattr(new, key) for key in part._fields if key in content})
                 for part, new in zip(defaults, found))


def _reason(source: str, settings: Settings, error: Exception) -> str:
    if isinstance(error, BagError):
        return str(error)
    if isinstance(error, (ValueError, OSError)):
        return '%s: %s' % (source, with_places(str(error), lambda name: option_of(name, settings)))
    return '%s: %s: %s' % (source, type(error).__name__, cause(error))


def option_of(name: str, settings: Settings) -> str:
    """Return the option that sets a parameter of the nodes with these settings; empty if no node has it."""
    files = [option + ' FILE' for option, node in FILES
             if any(name in part._fields for part in params_of(settings, node))]
    return _option_named(name) or ' and '.join(files)


def _option_named(name: str) -> str:
    return '--' + name.replace('_', '-') if name in OPTIONS else ''


def _summary(events: EventCounter, settings: Settings) -> List[str]:
    def placed(event: str) -> str:
        return with_places(events.sentences[event], lambda name: option_of(name, settings))

    lines = ['  %7d  %s%s' % (count, event, '. The first: %s' % placed(event)
                              if event in events.sentences else '') for event, count in events.counts.items()]
    return lines + ([] if events.counts.get(TRACKED) else ['no tracks: ' + _why_no_tracks(events, placed)])


def _why_no_tracks(events: EventCounter, placed: Callable[[str], str]) -> str:
    counts = events.counts
    event = max(set(events.sentences) - {POSE_FITTED, NOT_KEPT}, key=lambda each: (counts[each], each), default=None)
    if event is not None and counts[event] > counts.get('images tracked', 0):
        return placed(event)
    if counts.get('images tracked') and counts.get('boxes estimated'):
        return 'none of %d 3D boxes was confirmed by later images' % counts['boxes estimated']
    rejected = ['%d %s' % (counts[reason], reason) for reason in REASONS if reason in counts]
    if rejected:
        return 'no 2D box has a 3D position: ' + ', '.join(rejected)
    return ('no people were detected; rosrun ros_3d_bb doctor BAG checks the images and the orientation of the camera '
            '(--image-rotation)')


def _names(remaps: Iterable[str]) -> Dict[str, str]:
    names = {}
    for remap in remaps:
        ours, arrow, theirs = remap.partition(':=')
        if not (ours and arrow and theirs):
            raise ValueError('--remap %r; TOPIC_OF_THE_NODES:=TOPIC_IN_THE_BAG expected' % remap)
        names[ours.lstrip('/')] = theirs
    return names


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog='process_bag', description='Copy a bag and add 2D boxes, 3D boxes, tracks '
                                     'and markers. Equal inputs give identical bytes.')
    parser.add_argument('source', metavar='IN', help='bag to process')
    parser.add_argument('target', metavar='OUT', help='bag to write')
    parser.add_argument('--detector', choices=sorted(DETECTORS) + [NONE], default='yolov5',
                        help='none: use the 2D boxes in the bag (default: yolov5)')
    parser.add_argument('--weights', metavar='FILE', help='checkpoint or export for yolov5')
    for option, node in FILES:
        config = {'detection': 'DETECTOR'}.get(node, node)
        parser.add_argument(option, metavar='FILE', help='parameter file in the format of config/%s.yaml' % config)
    parser.add_argument('--error-model', metavar='FILE', help='error model for the 3D boxes')
    parser.add_argument('--depth', choices=DEPTH_TOPICS, help='raw: the depth images are not aligned to colour; they '
                        'are on camera/depth/image_rect_raw, their camera_info on camera/depth/camera_info, and the '
                        'transform between the cameras in tf (default: aligned)')
    parser.add_argument('--target-frame', metavar='FRAME', help='frame of the tracks (default: map)')
    parser.add_argument('--camera-height', type=float, metavar='M', help='for a bag without tf: height of the camera '
                        'above the floor, which is z = 0 of the target frame, metres')
    parser.add_argument('--camera-tilt', type=float, default=0.0, metavar='RAD', help='with --camera-height, pitch of '
                        'the camera, radians; positive: it looks down (default: 0)')
    parser.add_argument('--camera-roll', type=float, default=0.0, metavar='RAD', help='with --camera-height, roll of '
                        'the camera, radians; positive: its right side is lower (default: 0)')
    parser.add_argument('--camera-pose', choices=(FLOOR,), help='for a bag without tf: fit height, tilt and roll of '
                        'the camera to the floor in the depth images')
    parser.add_argument('--image-rotation', choices=IMAGE_ROTATION.choices, help='clockwise rotation that makes the '
                        'images upright, degrees (default: auto, from tf)')
    parser.add_argument('--cameras', metavar='NAMES', help='namespaces of several cameras, separated by commas (front, '
                        'rear: topics front/color/image_raw, ...)')
    parser.add_argument('--remap', action='append', default=[], metavar='TOPIC:=TOPIC',
                        help="a topic of the nodes and its name in the bag")
    parser.add_argument('--keep', nargs='*', metavar='TOPIC', help='topics of the input to copy (default: all)')
    parser.add_argument('--searches', type=int, default=0, metavar='N', help='number of images in which a '
                        'detector without depth runs in parallel (default: the number of cores); does not affect the '
                        'result')
    parser.add_argument('--compression', choices=('none', 'bz2', 'lz4'), default='lz4', help='default: lz4')
    return parser

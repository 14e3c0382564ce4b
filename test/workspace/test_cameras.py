"""Several cameras without a master: in bags, in the nodes' callbacks, and in launch files."""
import hashlib
import re

import numpy as np
import pytest
import rosbag
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, Transform, TransformStamped
from std_msgs.msg import Header

from ros_3d_bb.bag_processing import process_bag
from ros_3d_bb.bag_reading import BagError
from ros_3d_bb.bags import scenario_images, write_bag
from ros_3d_bb.evaluation.identities import score
from ros_3d_bb.following import TRACKING_PARAMS, Follower, TrackerNodeParams
from ros_3d_bb.geometry import OPTICAL_ROTATION, transform_from
from ros_3d_bb.messages import stamp_of, time_from
from ros_3d_bb.msg import BoundingBox3D, BoundingBox3DArray
from ros_3d_bb.nodes.tracker_node import TrackerNode
from ros_3d_bb.pipeline import Settings
from ros_3d_bb.process_bag import with_tracker
from ros_3d_bb.report import panels_of, read_recording
from ros_3d_bb.simulation.scenario import scenario_from
from ros_3d_bb.stamped import NS
from ros_3d_bb.tally import Tally
from support.launching import loaded
from support.masterless import masterless, on_the_wire

# Somebody walks from the view of the front camera into that of the left one; somebody stands where both see them.
SCENE = {'duration': 3.2, 'rate': 6.0, 'robot': {'cameras': [{'name': 'front'}, {'name': 'left', 'yaw': 0.6}]},
         'people': [{'start': [3.0, -0.2], 'moves': [{'to': [2.4, 2.2], 'speed': 0.9}]}, {'start': [4.6, 1.4]}]}
BOTH = with_tracker(Settings(detector='none'), cameras=['front', 'left'])
START_NS, PERIOD_NS = 1000 * NS, NS // 10


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """A bag of the scene with its 2D boxes, and what process_bag makes of it."""
    folder = tmp_path_factory.mktemp('bags')
    write_bag(scenario_images(scenario_from(SCENE), with_boxes=True), str(folder / 'in.bag'))
    process_bag(str(folder / 'in.bag'), str(folder / 'out.bag'), BOTH)
    return str(folder / 'in.bag'), str(folder / 'out.bag')


def messages_on(bag_path, topic):
    with rosbag.Bag(bag_path) as bag:
        return [message for _topic, message, _time in bag.read_messages('/' + topic)]


def test_everybody_is_one_track_wherever_they_are_seen(bags):
    with rosbag.Bag(bags[1]) as bag:
        recording = read_recording(bag)
    assert len(recording.moments) == recording.answered == 39
    result = score(recording.moments)
    for person in result.people:
        assert len(person.ids) == 1 and person.rmse_m < 0.25, person
    assert result.false_share == 0
    last = recording.moments[-1]
    assert len(last.tracks) == len(last.truth) == 2


def test_the_report_shows_images_of_both(bags):
    with rosbag.Bag(bags[1]) as bag:
        recording = read_recording(bag)
        assert len(recording.boxes) == 39 and len(panels_of(bag, recording)) == 6


def test_each_cameras_boxes_are_in_its_namespace_and_all_people_on_one_topic(bags):
    frames = {camera: set(message.header.frame_id for message in messages_on(bags[1], camera + '/ros_3d_bb/bb_3d'))
              for camera in ('front', 'left')}
    assert frames == {'front': {'front_color_optical_frame'}, 'left': {'left_color_optical_frame'}}
    tracks = messages_on(bags[1], 'ros_3d_bb/tracks')
    stamps = [stamp_of(message) for message in tracks]
    assert len(tracks) == 39 and stamps == sorted(stamps)
    assert not messages_on(bags[1], 'ros_3d_bb/bb_3d')


def test_the_same_bag_gives_the_same_bytes(bags, tmp_path):
    process_bag(bags[1], str(tmp_path / 'again.bag'), BOTH)  # also where results are there already
    digests = []
    for path in (bags[1], str(tmp_path / 'again.bag')):
        with open(path, 'rb') as stream:
            digests.append(hashlib.sha256(stream.read()).hexdigest())
    assert digests[0] == digests[1]


def test_a_camera_that_a_bag_does_not_have_is_named(bags, tmp_path):
    with pytest.raises(BagError, match='no std_msgs/Int32MultiArray on /rear/yolo_bounding_box; did you mean'):
        process_bag(bags[0], str(tmp_path / 'out.bag'), with_tracker(BOTH, cameras=['front', 'rear']))


def test_a_wrong_stamp_in_a_bag_keeps_the_other_camera_out_for_two_seconds_of_the_bag(bags, tmp_path):
    """The front camera ends with it, 0.7 s after the beginning."""
    path, last, left = str(tmp_path / 'in.bag'), None, []
    with rosbag.Bag(bags[0]) as bag, rosbag.Bag(path, 'w') as changed:
        start = bag.get_start_time()
        for topic, message, time in bag.read_messages():
            elapsed_s = time.to_sec() - start
            if topic.startswith('/front/') and elapsed_s > 0.7:
                if elapsed_s > 0.9:
                    continue
                set_back(message)
                last = time
            elif topic == '/left/yolo_bounding_box':
                left.append(time)
            changed.write(topic, message, time)
    process_bag(path, str(tmp_path / 'out.bag'), BOTH)
    with rosbag.Bag(str(tmp_path / 'out.bag')) as bag:
        answered = [time for _topic, _message, time in bag.read_messages('/ros_3d_bb/tracks') if time > last]
    assert answered and answered == [time for time in left if (time - last).to_sec() > 2]


def set_back(message):
    """Give a message of a camera a stamp of 10 s before."""
    if hasattr(message, 'header'):
        message.header.stamp -= rospy.Duration(10)
    else:
        label = message.layout.dim[0].label
        stamp = re.search(r'stamp=(\d+)', label).group(1)
        message.layout.dim[0].label = label.replace(stamp, str(int(stamp) - 10), 1)


def test_the_node_publishes_what_process_bag_writes(bags):
    found = []
    with masterless({'tf_timeout': 0.0, 'cameras': 'front, left'}) as connections, rosbag.Bag(bags[1]) as bag:
        TrackerNode()
        for topic, message, _time in bag.read_messages():
            name = topic if topic == '/tf' else topic[1:]
            if name in connections.subscribers:
                connections.send(name, on_the_wire(message))
                if name.endswith('bb_3d'):
                    found.append(connections.publishers['ros_3d_bb/tracks'].newest)
    assert [str(message) for message in found] == [str(message) for message in messages_on(bags[1], 'ros_3d_bb/tracks')]


class Transforms(object):
    """Cameras that look along x from one place; none for the frames in `missing`. By frame, `while_waiting` is called
    in the next wait for one.
    """

    def __init__(self):
        self.missing, self.while_waiting, self.jumps = set(), {}, 0

    def lookup(self, _target, source, _stamp):
        self.while_waiting.pop(source, lambda: None)()
        if source in self.missing:
            raise tf2_ros.LookupException('no such frame')
        return transform_from((0, 0, 1), OPTICAL_ROTATION)

    def go_back(self):
        self.jumps += 1


class Rig(object):
    """A Follower of two cameras, and boxes for it, which arrive at `now_ns`."""

    def __init__(self):
        self.now_ns = 0
        self.transforms, self.tally = Transforms(), Tally()
        params = TrackerNodeParams(cameras=['front', 'rear'])
        self.follower = Follower(params, [kind() for kind in TRACKING_PARAMS], self.tally, self.transforms)

    def send(self, stamp_ns, camera, frame_id=None, count=1):
        return self.follower.add_boxes(boxes(stamp_ns, frame_id or camera, count), self.now_ns, camera)


def boxes(stamp_ns, frame_id, count=1):
    box = BoundingBox3D()
    box.center.position.z = 3.0
    box.size.x, box.size.y, box.size.z = 0.5, 1.7, 0.5
    return BoundingBox3DArray(header=Header(stamp=time_from(stamp_ns), frame_id=frame_id), boxes=[box] * count)


@pytest.fixture
def rig():
    return Rig()


def test_stamps_of_tracks_never_go_back_whichever_camera_is_late(rig):
    random, stamps = np.random.RandomState(3), []
    for number in range(40):
        for camera, late in (('front', 0), ('rear', 3)):
            if number >= late:
                stamp_ns = START_NS + (number - late) * PERIOD_NS + random.randint(PERIOD_NS // 2)
                followed = rig.send(stamp_ns, camera)
                stamps.append(stamp_of(followed))
    assert stamps == sorted(stamps) and [track.id for track in followed.tracks] == [1]


def test_a_camera_that_is_far_behind_the_other_is_no_jump_in_time(rig):
    """By 1.5 s: its images are refused, and the tracks go on."""
    for number in range(30):
        followed = rig.send(START_NS + number * PERIOD_NS, 'front')
        with pytest.raises(ValueError, match='late'):
            rig.send(START_NS + (number - 15) * PERIOD_NS, 'rear')
    assert not rig.transforms.jumps and [track.id for track in followed.tracks] == [1]


def test_where_time_goes_back_images_of_the_time_before_are_left_out(rig):
    """A bag loops; the rear camera's detector takes longer. Tracks begin once more, and once only."""
    for number in range(200):
        for camera in ('front', 'rear'):
            rig.send(START_NS + number * PERIOD_NS, camera)
    for number in range(20):
        front = rig.send(START_NS + number * PERIOD_NS, 'front')
        late = number - 3
        rear = rig.send(START_NS + (200 + late if late < 0 else late) * PERIOD_NS, 'rear')
        assert (rear is None) == (late < 0)
    assert rig.transforms.jumps == 1 and rig.tally.counts['images of the time before'] == 3
    assert [track.id for track in front.tracks] == [2] and stamp_of(rear) == START_NS + 19 * PERIOD_NS


def test_a_camera_whose_stamps_alone_go_back_keeps_the_others_out_for_two_seconds(rig):
    """Its clock was corrected by 10 s, or its driver started again: then it is the one that is late."""
    answered = []
    for number in range(400):
        rig.now_ns = number * PERIOD_NS
        stamp_ns = START_NS + number * PERIOD_NS - (10 * NS if number >= 100 else 0)
        if number <= 120:
            rig.send(stamp_ns, 'front')
        else:
            with pytest.raises(ValueError, match='is 9.900 s before the latest'):
                rig.send(stamp_ns, 'front')
        followed = rig.send(START_NS + number * PERIOD_NS, 'rear')
        answered.append(followed is not None)
    assert answered == [True] * 100 + [False] * 20 + [True] * 280, answered
    assert rig.transforms.jumps == 1 and len(followed.tracks) == 1


def test_a_camera_that_ends_with_one_wrong_stamp_keeps_the_others_out_for_two_seconds(rig):
    for number in range(100):
        for camera in ('front', 'rear'):
            rig.send(START_NS + number * PERIOD_NS, camera)
    rig.send(START_NS, 'front')
    answered = []
    for number in range(100, 200):
        followed = rig.send(START_NS + number * PERIOD_NS, 'rear')
        answered.append(followed is not None)
        rig.now_ns += PERIOD_NS
    assert answered == [False] * 20 + [True] * 80 and len(followed.tracks) == 1
    assert 'boxes of rear at 1010.000 are taken for' in rig.tally.sentences['images of the time before']


def test_images_of_the_time_before_are_left_out_where_time_goes_back_twice(rig):
    """Somebody seeks in a bag, and once more, before the rear camera's detector is ready."""
    for number in range(200):
        for camera in ('front', 'rear'):
            rig.send(START_NS + number * PERIOD_NS, camera)
    for seconds in (10, 5):
        rig.send(START_NS + seconds * NS, 'front')
    assert rig.send(START_NS + 200 * PERIOD_NS, 'rear') is None
    assert rig.send(START_NS + 5 * NS + PERIOD_NS, 'front') is not None


def test_an_image_that_waits_for_its_transform_while_time_goes_back_is_left_out(rig):
    """The front camera's first image of the new time comes in the rear camera's wait; the rear camera ends there."""
    for number in range(200):
        rig.send(START_NS + number * PERIOD_NS, 'front')
    rig.transforms.while_waiting['rear'] = lambda: rig.send(START_NS, 'front')
    assert rig.send(START_NS + 200 * PERIOD_NS, 'rear') is None
    for number in range(1, 20):
        front = rig.send(START_NS + number * PERIOD_NS, 'front')
    assert rig.transforms.jumps == 1 and rig.tally.counts['images of the time before'] == 1
    assert [track.id for track in front.tracks] == [2]


def test_an_image_that_found_no_transform_while_time_went_back_hides_nobody_of_the_new_time(rig):
    """Were it counted as skipped, the rear camera's next one would be taken for that of a moment later."""
    for number in range(200):
        rig.send(START_NS + number * PERIOD_NS, 'front')
    rig.transforms.missing.add('rear')
    rig.transforms.while_waiting['rear'] = lambda: rig.send(START_NS, 'front')
    assert rig.send(START_NS + 200 * PERIOD_NS, 'rear') is None
    rig.transforms.missing.clear()
    for number in range(1, 6):
        front = rig.send(START_NS + number * PERIOD_NS, 'front')
    assert len(front.tracks) == 1
    assert rig.send(START_NS + 17 * PERIOD_NS, 'rear', count=0).tracks == []


def test_the_node_publishes_nothing_of_the_time_before():
    """The tf buffer is asked for the rear camera's transform when the front camera's stamps go back."""
    with masterless({'tf_timeout': 0.0, 'cameras': 'front, rear'}) as connections:
        TrackerNode()
        tracks, transforms = connections.publishers['ros_3d_bb/tracks'], Transforms()

        def send(camera, seconds):
            connections.send(camera + '/ros_3d_bb/bb_3d', on_the_wire(boxes(START_NS + seconds * NS, camera)))

        def lookup(target, source, stamp):
            transforms.lookup(target, source, stamp)
            return TransformStamped(transform=Transform(rotation=Quaternion(-0.5, 0.5, -0.5, 0.5)))
        connections.buffers[0].lookup_transform = lookup
        send('front', 20)
        transforms.while_waiting['rear'] = lambda: send('front', 0)
        send('rear', 20)
        assert tracks.count == 2 and tracks.newest.header.stamp == time_from(START_NS)


def test_a_camera_without_a_transform_leaves_the_other_to_go_on(rig):
    rig.transforms.missing.add('rear')
    for number in range(20):
        followed = rig.send(START_NS + number * PERIOD_NS, 'front', count=int(number < 10))
        assert rig.send(START_NS + number * PERIOD_NS + PERIOD_NS // 2, 'rear') is None
    assert followed.tracks == [] and rig.tally.counts['no transform'] == 20


def test_cameras_with_the_same_frame_are_taken_and_pointed_out(rig):
    for number in range(10):
        for camera in ('front', 'rear'):
            followed = rig.send(START_NS + number * PERIOD_NS, camera, frame_id='camera_color_optical_frame')
    assert [track.id for track in followed.tracks] == [1]
    assert rig.tally.counts['cameras with one frame'] == 1
    assert 'front and rear are all in the frame camera_color' in rig.tally.sentences['cameras with one frame']


@pytest.mark.parametrize('params,complaint', [
    ({'cameras': ['front', 'front']}, 'different namespaces expected'),
    ({'cameras': ['front camera']}, 'different namespaces expected'), ({'cameras': [1]}, 'different namespaces'),
    ({'cameras': ['front', 'rear'], 'camera_frame': 'mount'}, 'one frame serves one camera only'),
    ({'cameras': ['front'], 'tracker': 'thesis'}, 'knows one camera only')])
def test_parameters_that_make_no_sense_are_refused(params, complaint):
    with pytest.raises(ValueError, match=complaint):
        Follower(TrackerNodeParams(**params), [kind() for kind in TRACKING_PARAMS], Tally(), Transforms())


@pytest.mark.parametrize('cameras', ['front,rear', 'front, left, rear', 'front'])
def test_the_pipeline_starts_a_detector_and_bbox3d_for_each_camera_and_one_tracker(cameras):
    parameters, _nodes = loaded('pipeline.launch', 'detector:=depth', 'cameras:=' + cameras)
    names = [name.strip() for name in cameras.split(',')]
    started = set(name.rsplit('/', 1)[0] for name in parameters if name.count('/') > 1)
    assert started - {'/tracker_node'} == set('/%s/%s' % (name, node) for name in names
                                              for node in ('depth_detector_node', 'bbox3d_node'))
    assert parameters['/tracker_node/cameras'] == cameras

"""Checks of the camera_info and the images of a camera: calibration, alignment of depth to colour, and encodings."""
from ros_3d_bb.camera.alignment import ALIGN, frames_fault, info_size_fault, intrinsics_fault, size_fault
from ros_3d_bb.conversions.camera_msgs import DEPTH_TOPICS
from ros_3d_bb.conversions.image_msgs import DEPTH_SCALES
from ros_3d_bb.diagnosis.observations import Finding
from ros_3d_bb.diagnosis.roles import INFO
from ros_3d_bb.diagnosis.tf_tree import root_of

FILES_OF_SCALE = 'a file passed as bbox3d_params:=, tracker_params:= and, for detector:=depth, detector_params:='
UNIT_FIX = ('correct the driver, or set depth_scale to metres per unit (1.0 for metres, 0.001 for millimetres) in '
            + FILES_OF_SCALE)
NO_DEPTH_FIX = ('pass the topic of depth images in 16UC1 or 32FC1 (camera_depth:=TOPIC); compressed ones end in '
                '/compressedDepth: JPEG changes depth')


def check_camera(seen):
    if seen.color_info is None:
        return
    info, camera, fault = seen.color_info
    if fault:
        yield Finding('camera', '', '%s: %s' % (seen.streams[INFO].topic, fault),
                      'calibrate the camera (camera_calibration) at this image size, and pass the file to the driver; '
                      'a RealSense has its own calibration')
    elif _color_size_fault(seen):
        yield Finding('camera', '', _color_size_fault(seen), 'the driver must publish the calibration for the size of '
                      'its images, or they must be recorded at the size of the calibration')
    else:
        yield Finding('camera', '%d x %d pixels, focal length %.0f, frame %s' % (camera[:3] + (info.header.frame_id,)))


def _color_size_fault(seen):
    """Return why the camera_info is not that of the colour images; empty if it may be, or none was received."""
    if seen.color is None or seen.color.fault:
        return ''
    image = seen.color.message
    return info_size_fault(seen.color_info.converted, image.width, image.height, seen.streams[INFO].topic)


def check_alignment(seen):
    """Check that depth has the image size, intrinsics and frame of colour."""
    if seen.depth is None or seen.color_info is None or seen.color_info.fault or _color_size_fault(seen):
        return
    if seen.depth_is_raw:
        yield Finding('alignment', 'raw depth, which the nodes register to colour', *_registration_fault(seen))
        return
    depth, camera = seen.depth.message, seen.color_info.converted
    of_size = size_fault(camera, depth.width, depth.height) if depth.width else ''  # an empty image has no encoding
    of_images, agrees = of_size or seen.edges_fault, seen.edges_fault == ''
    of_frames, of_info = _frames_fault(seen), _depth_info_fault(seen)
    if of_images or (of_frames or of_info) and not agrees:
        yield Finding('alignment', '', of_images or of_frames or of_info, 'if depth is aligned to colour, its frame '
                      'and camera_info must be those of colour; if not: ' + ALIGN)
    elif of_frames:
        yield Finding('alignment', '', of_frames + ', although depth has the pixels of colour',
                      'pass frame_id:=%s (process_bag: frame_id in the files of --bbox3d-params and --detector-params)'
                      % seen.color_info.message.header.frame_id, False)
    else:
        beside = '; %s, but the images agree, and those of colour are used' % of_info if of_info else ''
        yield Finding('alignment', 'depth has the pixels and the frame of colour' + beside)


def _frames_fault(seen):
    frame_id = seen.color_info.message.header.frame_id
    return '' if seen.frame_id else frames_fault(frame_id, seen.depth.message.header.frame_id)


def _depth_info_fault(seen):
    is_known = seen.depth_info is not None and not seen.depth_info.fault
    return intrinsics_fault(seen.color_info.converted, seen.depth_info.converted) if is_known else ''


def _registration_fault(seen):
    """Return why raw depth in a bag cannot be registered, and the fix; empty if it can."""
    if not seen.is_bag:
        return ()
    if seen.depth_info is None:
        return ('there is no camera_info of the depth camera', 'record it, or remap %s to it' % DEPTH_TOPICS['raw'][1])
    color, depth = (one.message.header.frame_id.lstrip('/') for one in (seen.color_info, seen.depth))
    links = seen.tf.links if seen.tf is not None else {}
    if root_of(links, color) != root_of(links, depth):
        return ('tf has no transform from %s to %s, with which raw depth is registered' % (depth, color),
                'record /tf_static of the camera driver (publish_tf:=true)')
    return ()


def check_encodings(seen):
    is_depth = seen.depth is not None and seen.depth.message.encoding in DEPTH_SCALES
    for subject, image, fix in (
            ('colour', seen.color, 'set the camera to rgb8 or bgr8'),
            ('depth', seen.depth, UNIT_FIX if is_depth else NO_DEPTH_FIX)):
        if image is not None:
            fact = '%s, %d x %d pixels' % (image.message.encoding, image.message.width, image.message.height)
            yield Finding(subject + ' encoding', fact, image.fault, fix)

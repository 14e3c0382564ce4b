"""Depth that is not aligned to colour."""
SAME_PX = 1.0  # intrinsics that differ by less are the same: half a pixel is 1 cm at 6 m
ALIGN = ('start the camera with realsense.launch, or realsense2_camera with align_depth:=true, and take '
         'camera/aligned_depth_to_color/image_raw')


def size_fault(color, width, height):
    """Whether a depth image has another size than the camera of the colour image; a phrase, or empty.

    Parameters
    ----------
    color : geometry.Camera
    width, height : int
        Pixels of the depth image.
    """
    if (width, height) == color[:2]:
        return ''
    return 'the depth image has %d x %d pixels, the colour camera %d x %d' % ((width, height) + color[:2])


def intrinsics_fault(color, depth):
    """In what the camera of a depth image differs from that of the colour image; a phrase, empty where in nothing.

    Parameters
    ----------
    color, depth : geometry.Camera
    """
    if color[:2] != depth[:2]:
        return 'the depth camera has %d x %d pixels, the colour camera %d x %d' % (depth[:2] + color[:2])
    if max(abs(mine - other) for mine, other in zip(color[2:6], depth[2:6])) > SAME_PX:
        return ('the intrinsics fx fy cx cy of depth are %.1f %.1f %.1f %.1f, those of colour %.1f %.1f %.1f %.1f'
                % (depth[2:6] + color[2:6]))
    return ''


def frames_fault(color_frame, depth_frame):
    """Whether a depth image says that it was taken in another frame than the colour image; a phrase, or empty."""
    if color_frame and depth_frame and color_frame.lstrip('/') != depth_frame.lstrip('/'):
        return 'the depth image is in the frame %s, the colour camera in %s' % (depth_frame, color_frame)
    return ''

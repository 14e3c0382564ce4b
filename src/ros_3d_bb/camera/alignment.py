"""Checks whether the depth image is aligned to the colour image."""
SAME_PX = 1.0  # intrinsics that differ by less count as equal: half a pixel is 1 cm at 6 m
ALIGN = ('start the camera with realsense.launch, or realsense2_camera with align_depth:=true, and take '
         'camera/aligned_depth_to_color/image_raw')


def size_fault(color, width, height):
    """Compare the size of a depth image with that of the colour camera.

    Parameters
    ----------
    color : camera_model.Camera
    width, height : int
        Size of the depth image, pixels.

    Returns
    -------
    str
        Description of the difference; empty if the sizes are equal.
    """
    if (width, height) == color[:2]:
        return ''
    return 'the depth image has %d x %d pixels, the colour camera %d x %d' % ((width, height) + color[:2])


def intrinsics_fault(color, depth):
    """Compare the intrinsics of the depth camera with those of the colour camera.

    Parameters
    ----------
    color, depth : camera_model.Camera

    Returns
    -------
    str
        Description of the difference; empty if the intrinsics agree within `SAME_PX`.
    """
    if color[:2] != depth[:2]:
        return 'the depth camera has %d x %d pixels, the colour camera %d x %d' % (depth[:2] + color[:2])
    if max(abs(mine - other) for mine, other in zip(color[2:6], depth[2:6])) > SAME_PX:
        return ('the intrinsics fx fy cx cy of depth are %.1f %.1f %.1f %.1f, those of colour %.1f %.1f %.1f %.1f'
                % (depth[2:6] + color[2:6]))
    return ''


def frames_fault(color_frame, depth_frame):
    """Compare the frame_id of a depth image with that of the colour image.

    Returns
    -------
    str
        Description of the difference; empty if the frames are equal or one of them is unknown.
    """
    if color_frame and depth_frame and color_frame.lstrip('/') != depth_frame.lstrip('/'):
        return 'the depth image is in the frame %s, the colour camera in %s' % (depth_frame, color_frame)
    return ''

// Prints the ID, position and velocity of each track of each image.
#include <ros/ros.h>
#include <ros_3d_bb/TrackedObjectArray.h>

void onTracks(const ros_3d_bb::TrackedObjectArray::ConstPtr& message)
{
  for (const auto& track : message->objects)
  {
    const auto& position = track.pose.pose.position;
    const auto& velocity = track.twist.twist.linear;
    ROS_INFO("%s %u at %.2f %.2f in %s, %.2f m/s to x, %.2f m/s to y", track.label.c_str(), track.id, position.x,
             position.y, message->header.frame_id.c_str(), velocity.x, velocity.y);
  }
}

int main(int argc, char** argv)
{
  ros::init(argc, argv, "print_tracks");
  ros::NodeHandle node;
  ros::Subscriber subscriber = node.subscribe("ros_3d_bb/tracks", 1, onTracks);
  ros::spin();
}

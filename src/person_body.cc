#include <gazebo/common/Plugin.hh>
#include <gazebo/physics/physics.hh>

/// Plugin of an actor whose link "body" has collision geometry: adds the link to the physics engine, which Gazebo
/// does not do for actors. The actor moves its links. Without the plugin, collisions and rays miss the body.
class PersonBody : public gazebo::ModelPlugin
{
  void Load(gazebo::physics::ModelPtr actor, sdf::ElementPtr) override
  {
    const auto body = actor->GetLink("body");
    if (!body)
    {
      gzerr << "The actor '" << actor->GetName() << "' has no link 'body'" << std::endl;
      return;
    }
    body->Init();
    body->SetKinematic(true);  // follows the commanded motion, and pushes what it touches
  }
};

GZ_REGISTER_MODEL_PLUGIN(PersonBody)

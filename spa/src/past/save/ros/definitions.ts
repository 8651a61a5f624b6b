/** The definitions of ROS 2 messages (`ros2msg`), which a reader of an MCAP file decodes them with. */

const SEPARATOR = '='.repeat(80);
const PARTS = {
  'builtin_interfaces/Time': 'int32 sec\nuint32 nanosec',
  'std_msgs/Header': 'builtin_interfaces/Time stamp\nstring frame_id',
  'geometry_msgs/Vector3': 'float64 x\nfloat64 y\nfloat64 z',
  'geometry_msgs/Quaternion': 'float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1',
  'geometry_msgs/Transform': 'geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation',
  'geometry_msgs/TransformStamped':
    'std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform',
  'geometry_msgs/Wrench': 'geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque',
  'std_msgs/MultiArrayDimension': 'string label\nuint32 size\nuint32 stride',
  'std_msgs/MultiArrayLayout': 'std_msgs/MultiArrayDimension[] dim\nuint32 data_offset',
} as const;
const STAMPED = ['std_msgs/Header', 'builtin_interfaces/Time'] as const;

/** For each message type: its definition, and those of all types that it contains. */
export const DEFINITIONS = {
  'sensor_msgs/msg/JointState': define(
    'std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort',
    ...STAMPED,
  ),
  'sensor_msgs/msg/Imu': define(
    [
      'std_msgs/Header header',
      'geometry_msgs/Quaternion orientation',
      'float64[9] orientation_covariance',
      'geometry_msgs/Vector3 angular_velocity',
      'float64[9] angular_velocity_covariance',
      'geometry_msgs/Vector3 linear_acceleration',
      'float64[9] linear_acceleration_covariance',
    ].join('\n'),
    ...STAMPED,
    'geometry_msgs/Quaternion',
    'geometry_msgs/Vector3',
  ),
  'geometry_msgs/msg/WrenchStamped': define(
    'std_msgs/Header header\ngeometry_msgs/Wrench wrench',
    ...STAMPED,
    'geometry_msgs/Wrench',
    'geometry_msgs/Vector3',
  ),
  'tf2_msgs/msg/TFMessage': define(
    'geometry_msgs/TransformStamped[] transforms',
    'geometry_msgs/TransformStamped',
    ...STAMPED,
    'geometry_msgs/Transform',
    'geometry_msgs/Vector3',
    'geometry_msgs/Quaternion',
  ),
  'rcl_interfaces/msg/Log': define(
    [
      'byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50',
      'builtin_interfaces/Time stamp\nuint8 level',
      'string name\nstring msg\nstring file\nstring function\nuint32 line',
    ].join('\n'),
    'builtin_interfaces/Time',
  ),
  'std_msgs/msg/Float64MultiArray': define(
    'std_msgs/MultiArrayLayout layout\nfloat64[] data',
    'std_msgs/MultiArrayLayout',
    'std_msgs/MultiArrayDimension',
  ),
} as const;

export type MessageType = keyof typeof DEFINITIONS;

function define(own: string, ...parts: readonly (keyof typeof PARTS)[]): string {
  return [own, ...parts.map((name) => `${SEPARATOR}\nMSG: ${name}\n${PARTS[name]}`), ''].join('\n');
}

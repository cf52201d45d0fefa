#!/bin/sh
# A researcher's own arm: from a URDF with a mesh to a verdict in simulation, and back to a URDF.
# After docs/guide/own-arm.md, "Without a recording". About half a minute.
#   ARMCAL=target/release/armcal sh tests/journeys/researcher.sh
set -eu
. "$(dirname "$0")/steps.sh"
cd "$FOLDER"

link() { # NAME RADIUS LENGTH MASS CENTRE
    echo "  <link name=\"$1\">"
    echo "    <inertial><origin xyz=\"0 0 $5\"/><mass value=\"$4\"/>"
    echo '      <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
    echo "    <collision><origin xyz=\"0 0 $5\"/><geometry><cylinder radius=\"$2\" length=\"$3\"/></geometry></collision>"
    echo '  </link>'
}
joint() { # NAME PARENT CHILD HEIGHT AXIS RANGE EFFORT
    echo "  <joint name=\"$1\" type=\"revolute\"><parent link=\"$2\"/><child link=\"$3\"/>"
    echo "    <origin xyz=\"0 0 $4\"/><axis xyz=\"$5\"/>"
    echo "    <limit lower=\"-$6\" upper=\"$6\" effort=\"$7\" velocity=\"0.5\"/></joint>"
}

step 'draw an arm of six joints, its hand a mesh with a wrist camera'
mkdir meshes
{
    echo '<?xml version="1.0"?>'
    echo '<robot name="bench-arm">'
    link base_link 0.08 0.10 4 0.05
    link shoulder 0.06 0.10 3 0.05
    link upper_arm 0.05 0.30 3 0.20
    link forearm 0.045 0.25 2 0.17
    link wrist_1 0.04 0.06 1 0.03
    link wrist_2 0.04 0.06 1 0.03
    cat <<'END'
  <link name="hand">
    <inertial><origin xyz="0 0 0.04"/><mass value="0.6"/>
      <inertia ixx="0.002" iyy="0.002" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="meshes/hand.stl"/></geometry></visual>
    <collision><geometry><mesh filename="meshes/hand.stl"/></geometry></collision>
  </link>
  <link name="camera_optical"/>
  <link name="tip"/>
END
    joint j1 base_link shoulder 0.15 "0 0 1" 2.9 150
    joint j2 shoulder upper_arm 0.12 "0 1 0" 2.0 150
    joint j3 upper_arm forearm 0.42 "0 1 0" 2.5 100
    joint j4 forearm wrist_1 0.36 "0 1 0" 2.0 40
    joint j5 wrist_1 wrist_2 0.09 "0 0 1" 2.9 40
    joint j6 wrist_2 hand 0.09 "0 1 0" 1.8 40
    cat <<'END'
  <joint name="camera_mount" type="fixed"><parent link="hand"/><child link="camera_optical"/>
    <origin xyz="0.07 0 0.06"/></joint>
  <joint name="tip_mount" type="fixed"><parent link="hand"/><child link="tip"/>
    <origin xyz="0 0 0.14"/></joint>
</robot>
END
} >arm.urdf
# A block of 6 x 5 x 10 cm as ASCII STL: 12 triangles over the corners 0 .. 7.
awk '
function corner(k) { return sprintf("      vertex %.3f %.3f %.3f\n", (k % 2) * 0.06 - 0.03, (int(k / 2) % 2) * 0.05 - 0.025, int(k / 4) * 0.1) }
BEGIN {
    n = split("0 2 1 1 2 3 4 5 6 5 7 6 0 1 4 1 5 4 2 6 3 3 6 7 0 4 2 2 4 6 1 3 5 3 7 5", k, " ")
    print "solid hand"
    for (i = 1; i < n; i += 3)
        printf "  facet normal 0 0 0\n    outer loop\n%s%s%s    endloop\n  endfacet\n", corner(k[i]), corner(k[i + 1]), corner(k[i + 2])
    print "endsolid hand"
}' >meshes/hand.stl

step 'make a robot folder of it'
expect 0 "$ARMCAL" new-robot arm.urdf --out my-arm
sees '6 joints from `base_link`'
sees 'left for run and plan: stowed_rad'
sees 'left for run and plan: base_tag'
sees 'left for run and plan: [camera] lens'
finds my-arm/meshes/hand.stl
expect 0 "$ARMCAL" check my-arm
sees 'warning: my-arm: run and plan will refuse it'

step 'fill in what is left: the stowed angles, the lens, ten tags'
sed -E -e 's/^# (stowed_rad|base_tag|model|resolution_px|focal_px|center_px|distortion|corner_std_px) = /\1 = /' \
    -e '/^# Tags of the family/,$d' my-arm/robot.toml >filled.toml
cp filled.toml my-arm/robot.toml
tag() { # ID PLACE QUATERNION
    printf '[[tag]]\nid = %s\nfamily = "36h11"\nsize_m = 0.15\nposition_m = [%s]\nquaternion_wxyz = [%s]\n' "$1" "$2" "$3"
    printf 'position_std_m = 0.001\nrotation_std_rad = 0.0035\n\n'
}
{
    down='0.0, 1.0, 0.0, 0.0'
    towards='0.70711, 0.0, -0.70711, 0.0'
    tag 0 '0.3, -0.5, 2.0' "$down"
    tag 1 '0.3, 0.0, 2.0' "$down"
    tag 2 '0.3, 0.5, 2.0' "$down"
    tag 3 '0.9, -0.5, 2.0' "$down"
    tag 4 '0.9, 0.0, 2.0' "$down"
    tag 5 '0.9, 0.5, 2.0' "$down"
    tag 6 '1.6, -0.6, 0.8' "$towards"
    tag 7 '1.6, 0.0, 0.9' "$towards"
    tag 8 '1.6, 0.6, 0.8' "$towards"
    tag 9 '1.6, 0.0, 1.5' "$towards"
} >>my-arm/robot.toml
cp "$REPOSITORY/robots/vehicles/fixed-base.toml" .
cat >my-arm.toml <<'END'
version = 1
kind = "routine"
name = "my-arm"
robot = "my-arm"
vehicle = "fixed-base.toml"

[task]
tolerance_m = 0.02
targets_m = [[0.5, 0.1, 0.5], [0.4, -0.3, 0.6], [0.5, 0.3, 0.4]]
END
expect 0 "$ARMCAL" check my-arm my-arm.toml
sees 'ok: my-arm: robot `bench-arm`, 6 joints, 10 tags'
sees 'ok: my-arm.toml'

step 'plan on paper'
expect 0 "$ARMCAL" plan my-arm.toml --out plan
sees 'predicted after the last pose'
finds plan/plan.toml 'stop_reason = "poses"'

step 'run the loop in simulation: the verdict'
expect 0 "$ARMCAL" run my-arm.toml --out result
sees 'calibration  ACCEPTED'
sees '3 of 3'

step 'calibrate from its recording: the same result, byte for byte'
expect 0 "$ARMCAL" inspect result/run.mcap --robot my-arm
sees 'enough       views for a calibration and a verdict'
expect 0 "$ARMCAL" calibrate result/run.mcap --robot my-arm --out again
cmp result/calibration.toml again/calibration.toml || dead_end 'the two results differ'

step 'take the result back as a URDF, which is a robot again, and as ROS 2 parameters'
"$ARMCAL" export result/calibration.toml --as urdf --robot my-arm >calibrated.urdf || dead_end 'no URDF'
finds calibrated.urdf 'Written in: origin of joint camera_mount'
finds calibrated.urdf 'meshes/hand.stl'
expect 0 "$ARMCAL" new-robot calibrated.urdf --out calibrated-arm
expect 0 "$ARMCAL" export result/calibration.toml --as ros-parameters --robot my-arm
sees 'j1'

echo 'researcher: no dead end'

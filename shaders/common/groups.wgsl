// Dispatches of more workgroups than one row holds: the last row may be too long.

// Workgroups in a row; below the 65535 that every adapter allows.
const ROW: u32 = 32768u;

// The number of a workgroup, from 0.
fn group_index(group: vec3u) -> u32 {
    return group.x + ROW * group.y;
}

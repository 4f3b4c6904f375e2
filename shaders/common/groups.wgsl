// Workgroup indices in dispatches of several rows. The last row may have excess workgroups.

// Workgroups in a row; below the limit of 65535 that every adapter supports.
const ROW: u32 = 32768u;

// Linear index of a workgroup.
fn group_index(group: vec3u) -> u32 {
    return group.x + ROW * group.y;
}

// Numbers of workgroups of indirect dispatches. Needs `arguments`.

fn set_arguments(which: u32, groups: u32) {
    arguments[4u * which] = min(groups, ROW);
    arguments[4u * which + 1u] = (groups + ROW - 1u) / ROW;
    arguments[4u * which + 2u] = 1u;
}

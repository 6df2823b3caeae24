// Pixels are handed on in registers: for workgroups that step together as one subgroup.

fn receive(passing: Passing, p: u32, there: bool, lane: u32) -> Passing {
    // All threads take part, whether they have a pixel or not.
    let before = Passing(subgroupShuffleUp(passing.t, 1u), subgroupShuffleUp(passing.rest, 1u));
    if lane == 0u && there {
        return Passing(transmittances[p], remains[p]);
    }
    return before;
}

fn hand_on(passing: Passing, p: u32, there: bool) {}

// Pixels are handed on through memory of the workgroup: works everywhere.

fn receive(passing: Passing, p: u32, there: bool, lane: u32) -> Passing {
    if there {
        return Passing(transmittances[p], remains[p]);
    }
    return passing;
}

fn hand_on(passing: Passing, p: u32, there: bool) {
    if there {
        transmittances[p] = passing.t;
        remains[p] = passing.rest;
    }
    workgroupBarrier();
}

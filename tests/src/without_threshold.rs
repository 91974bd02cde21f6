//! A device whose search takes any move that float32 calls a decrease: what the optimiser would be without its relative threshold.

use prbvh::device::{self, Buffer, Command, Device, DeviceError, Recording, Timing};
use prbvh_kernel::Kernel;
use prbvh_kernel::node::{Links, Node, ROOT};
use prbvh_kernel::prbvh::{PrbvhParams, Reinsertion};

/// Runs everything on the device inside, but the search naively and without a threshold.
pub struct WithoutThreshold(pub Box<dyn Device>);

impl std::fmt::Debug for WithoutThreshold {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("WithoutThreshold").field(&self.0.info().name).finish()
    }
}

impl device::Layer for WithoutThreshold {
    fn inner(&self) -> &dyn Device {
        &*self.0
    }

    fn inner_mut(&mut self) -> &mut dyn Device {
        &mut *self.0
    }

    fn run(&mut self, recording: &Recording) -> Result<Vec<Timing>, DeviceError> {
        let mut timings = Vec::new();
        for (label, command) in recording.commands() {
            let mut one = Recording::new();
            match command {
                Command::Clear(buffer) => one.clear(label, buffer),
                Command::Copy { from, to } => one.copy(label, from, to),
                Command::Dispatch(dispatch) => {
                    let buffers: Vec<&Buffer> = dispatch.buffers.iter().collect();
                    one.dispatch_bytes(label, dispatch.kernel, dispatch.count, &dispatch.push, &buffers);
                }
            }
            timings.extend(self.0.run(&one)?);
            if let Command::Dispatch(dispatch) = command
                && dispatch.kernel == Kernel::PrbvhSearch
            {
                let params: PrbvhParams = bytemuck::pod_read_unaligned(&dispatch.push);
                let mut nodes: Vec<Node> = vec![bytemuck::Zeroable::zeroed(); params.nodes as usize];
                self.0.download(&dispatch.buffers[0], bytemuck::cast_slice_mut(&mut nodes))?;
                let found: Vec<Reinsertion> = (0..params.count).map(|i| search(params.input(i), &nodes)).collect();
                self.0.upload(&dispatch.buffers[1], bytemuck::cast_slice(&found))?;
            }
        }
        Ok(timings)
    }
}

/// The output with the largest area decrease above 0, of all there are.
fn search(input: u32, nodes: &[Node]) -> Reinsertion {
    let mut best = Reinsertion::NONE;
    if input == ROOT {
        return best;
    }
    let above: Vec<u32> = ancestors(input, nodes);
    for output in 1..nodes.len() as u32 {
        if output == input || output == nodes.sibling(input) || above.contains(&output) {
            continue;
        }
        let area_decrease = area_decrease(input, output, &above, nodes);
        if area_decrease > best.area_decrease {
            best = Reinsertion { area_decrease, input, output };
        }
    }
    best
}

/// From the parent to the root.
fn ancestors(v: u32, nodes: &[Node]) -> Vec<u32> {
    std::iter::successors(Some(v), |&v| (v != ROOT).then(|| nodes.parent(v))).skip(1).collect()
}

/// The sum of `prbvh_kernel::prbvh` in float32; 0 where the output lies below the input or the move might close a loop.
fn area_decrease(input: u32, output: u32, above: &[u32], nodes: &[Node]) -> f32 {
    let aabb = |v: u32| nodes[v as usize].aabb();
    let (input_box, sibling) = (aabb(input), nodes.sibling(input));
    let mut increase = 0.0;
    let mut pivot = nodes.parent(output);
    while !above.contains(&pivot) {
        let area = aabb(pivot).half_area();
        if pivot == input || pivot != sibling && area <= input_box.half_area() {
            return 0.0;
        }
        increase += aabb(pivot).union(input_box).half_area() - area;
        pivot = nodes.parent(pivot);
    }
    let mut decrease = 0.0;
    let mut without = aabb(sibling);
    for pair in above.windows(2).take_while(|pair| pair[0] != pivot && pair[1] != pivot) {
        without = without.union(aabb(nodes.sibling(pair[0])));
        decrease += aabb(pair[1]).half_area() - without.half_area();
    }
    aabb(above[0]).half_area() - aabb(output).union(input_box).half_area() + (decrease - increase)
}

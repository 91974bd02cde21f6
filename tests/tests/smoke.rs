//! x
use prbvh::build::*;
use prbvh::device::cpu::CpuDevice;
use prbvh::optimize::*;
#[test]
fn smoke() {
    for n in [1, 2, 3, 10, 1000, 100_000] {
        let tris = prbvh_tests::fixtures::soup(n, 0.05, 1);
        let mut dev = CpuDevice::new(0).unwrap();
        let t = std::time::Instant::now();
        let (tree, _) = lbvh(&mut dev, &tris, MortonBits::Sixty).unwrap();
        let b = t.elapsed();
        let o = prbvh(&mut dev, &tree, &PrbvhSettings::default(), &mut |_, _, _| std::ops::ControlFlow::Continue(()))
            .unwrap();
        println!(
            "{n}: build {b:?} {:.3} -> {:.3} {} iterations {:.3}s {:?} bytes/node {} steps {}",
            o.rows[0].cost,
            o.best().cost,
            o.rows.len() - 1,
            o.rows.last().unwrap().time_s,
            o.stop,
            o.working_bytes / (2 * n as u64 - 1),
            o.rows.iter().map(|r| r.most_steps).max().unwrap()
        );
        if n == 1000 {
            for r in &o.rows {
                println!("{r:?}");
            }
        }
    }
}

//! A comparison without a measurement: numbers of a realistic size and shape, the same every time.

use prbvh::device::{DeviceInfo, DeviceKind};
use prbvh::optimize::IterationRow;
use prbvh_lab::compare::{
    AgainstRbvh, Comparison, MethodRow, OptimizerRun, Picture, Purpose, RayRates, RaySettings, SCHEMA, SceneComparison,
};
use prbvh_lab::report::{Machine, Phase, Program};

const SCENES: [(&str, u32); 10] = [
    ("conference", 331_179),
    ("sponza_crytek", 262_267),
    ("san-miguel", 10_500_551),
    ("hairball", 2_880_000),
    ("bunny", 69_451),
    ("armadillo", 345_944),
    ("buddha", 1_087_716),
    ("dragon", 871_414),
    ("powerplant", 12_759_246),
    ("rungholt", 6_704_264),
];
const DEVICE: &str = "llvmpipe (LLVM 19.1.7, 256 bits)";
const PHASES: [&str; 17] = [
    "search",
    "lock",
    "check",
    "reinsert",
    "refit",
    "cost",
    "morton",
    "sort count",
    "sort scan",
    "sort scatter",
    "hierarchy",
    "leaf boxes",
    "clear",
    "compact",
    "best",
    "copy",
    "bounds",
];

/// A method of the table: name, µ, cost relative to LBVH, build time in µs per triangle, iterations.
type Method = (&'static str, Option<u32>, f64, f64, u32);

/// Twelve methods.
pub const METHODS: [Method; 12] = [
    ("lbvh", None, 1.0, 0.16, 0),
    ("ploc r=10", None, 0.78, 0.41, 0),
    ("ploc r=100", None, 0.74, 1.9, 0),
    ("atrbvh", None, 0.71, 1.3, 0),
    ("sah-binned", None, 0.69, 0.9, 0),
    ("sah-sweep", None, 0.66, 4.1, 0),
    ("rbvh", None, 0.585, 900.0, 4000),
    ("prbvh", Some(1), 0.582, 9.5, 31),
    ("prbvh", Some(4), 0.589, 6.3, 58),
    ("prbvh", Some(9), 0.591, 5.2, 93),
    ("obvhs default", None, 0.64, 1.7, 0),
    ("obvhs best", None, 0.61, 11.0, 0),
];

/// `scenes` scenes with all methods, all figures and pictures. One row has failed.
///
/// # Panics
/// If a picture cannot be encoded.
#[must_use]
pub fn comparison(scenes: usize) -> Comparison {
    let scenes = (0..scenes).map(|k| scene(k, SCENES[k % SCENES.len()])).collect();
    Comparison {
        schema: SCHEMA,
        machine: Machine {
            cpu: "AMD EPYC 7763 64-Core Processor".to_owned(),
            cores: 2,
            memory_bytes: 8 << 30,
            os: "Debian GNU/Linux 12 (bookworm), x86_64".to_owned(),
        },
        program: Program {
            name: "prbvh".to_owned(),
            version: "0.1.0".to_owned(),
            commit: "4c56fef".to_owned(),
            command_line: ["prbvh", "compare", "scenes/conference room.obj.xz", "--mu", "1,4,9", "--out", "report"]
                .map(str::to_owned)
                .into(),
        },
        devices: vec![device(DEVICE, DeviceKind::VulkanCpu), device("AMD EPYC 7763, 2 threads", DeviceKind::Cpu)],
        repeat: 5,
        rays: Some(RaySettings { width: 640, height: 360, samples: 4, bounces: 3, light_samples: 1, views: 3 }),
        scenes,
    }
}

/// What must never run: `window.planted` would be set.
pub const PLANTED: &str =
    "</script></title></style><script>window.planted = 1</script><img src=x onerror='window.planted = 2'>\"&\u{1}";

/// A scene in which every text is [`PLANTED`], as names of files and devices may be.
///
/// # Panics
/// As [`comparison`].
#[must_use]
pub fn hostile() -> Comparison {
    let mut comparison = comparison(1);
    let planted = || PLANTED.to_owned();
    comparison.machine.cpu = planted();
    comparison.machine.os = planted();
    comparison.program.commit = planted();
    comparison.program.command_line.push(planted());
    for device in &mut comparison.devices {
        device.name = planted();
        device.driver = planted();
    }
    let scene = &mut comparison.scenes[0];
    scene.name = planted();
    scene.hash = planted();
    for row in &mut scene.rows {
        row.scene = planted();
        row.method = format!("{}{PLANTED}", row.method);
        row.device = planted();
        row.status = planted();
        row.tree_hash = Some(planted());
    }
    // The overview is drawn only with a cost of LBVH.
    scene.rows[0].method = "lbvh".to_owned();
    for run in &mut scene.runs {
        run.method = format!("{}{PLANTED}", run.method);
        run.initial = format!("{}{PLANTED}", run.initial);
        run.strategy = format!("{}{PLANTED}", run.strategy);
        run.device = planted();
        run.phases.iter_mut().for_each(|phase| phase.label.push_str(PLANTED));
    }
    scene.pictures.iter_mut().for_each(|picture| picture.title.push_str(PLANTED));
    scene.set_errors(None);
    comparison
}

fn device(name: &str, kind: DeviceKind) -> DeviceInfo {
    let mut info = DeviceInfo::new(name, kind);
    info.driver = "Mesa 25.0.4, Vulkan 1.4.305".to_owned();
    info.max_buffer_bytes = 128 << 20;
    info.max_buffer_limit = "maxStorageBufferRange";
    info.memory_bytes = 8 << 30;
    info.atomics_64 = true;
    info.busy_invocations = 2;
    info
}

/// In [0, 1), by chance but the same every time.
fn chance(seeds: &[u64]) -> f64 {
    let mix = |h: u64, seed: &u64| {
        let h = (h ^ seed).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        h ^ (h >> 29)
    };
    let h = seeds.iter().fold(0x1234_5678_9abc_def1, mix).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (h >> 11) as f64 / (1u64 << 53) as f64
}

fn scene(k: usize, (name, triangles): (&str, u32)) -> SceneComparison {
    let seed = k as u64;
    let lbvh = 60.0 + 250.0 * chance(&[seed, 1]);
    // Some scenes gain a lot by optimisation, others little.
    let gain = 0.75 + 0.5 * chance(&[seed, 2]);
    let cost = |relative: f64, m: u64| {
        lbvh * (1.0 - (1.0 - relative) * gain) * (1.0 + 0.01 * chance(&[seed, m, 3]) * (1.0 - relative))
    };
    let mut rows = Vec::new();
    let mut runs = Vec::new();
    for (m, &(method, mu, relative, micros, iterations)) in METHODS.iter().enumerate() {
        let m = m as u64;
        let cost = cost(relative, m);
        let build_s = micros * 1e-6 * f64::from(triangles) * (0.9 + 0.2 * chance(&[seed, m, 4]));
        let failed = method == "obvhs best" && k % 10 == 2;
        rows.push(if failed {
            MethodRow {
                scene: name.to_owned(),
                method: method.to_owned(),
                device: "cpu (peer)".to_owned(),
                threads: 2,
                status: "panicked at 'index out of bounds: the len is 0 but the index is 4294967295'".to_owned(),
                ..MethodRow::default()
            }
        } else {
            row(name, METHODS[m as usize], triangles, cost, build_s, [seed, m])
        });
        if !failed {
            let initial = if iterations == 0 { method } else { "lbvh" };
            runs.push(run(
                Purpose::Table,
                (method, initial, mu.unwrap_or(0)),
                [lbvh, cost],
                build_s,
                iterations,
                [seed, m],
            ));
        }
    }
    let optimised = |relative: f64, mu: u32| cost(relative + 0.001 * f64::from(mu), u64::from(mu));
    let build = |micros: f64| micros * 1e-6 * f64::from(triangles);
    for mu in [1, 2, 3, 4, 6, 9, 16, 32] {
        let seconds = build(3.0 + 7.0 / f64::from(mu));
        runs.push(run(
            Purpose::Mu,
            ("prbvh", "lbvh", mu),
            [lbvh, optimised(0.58, mu)],
            seconds,
            28 + 7 * mu,
            [seed, 50 + u64::from(mu)],
        ));
    }
    for (strategy, relative, micros, iterations) in [("aggressive", 0.591, 5.2, 93), ("conservative", 0.594, 14.0, 212)]
    {
        let mut run = run(
            Purpose::Strategy,
            ("prbvh", "lbvh", 9),
            [lbvh, optimised(relative, 9)],
            build(micros),
            iterations,
            [seed, 70],
        );
        run.strategy = strategy.to_owned();
        runs.push(run);
    }
    for (initial, relative, micros) in [("atrbvh", 0.71, 1.3), ("ploc r=100", 0.74, 1.9), ("sah-binned", 0.69, 0.9)] {
        let costs = [cost(relative, 80), optimised(0.585, 9)];
        runs.push(run(
            Purpose::Initial,
            ("prbvh", initial, 9),
            costs,
            build(micros + 3.4),
            61,
            [seed, 80 + initial.len() as u64],
        ));
    }
    let mut scene = SceneComparison {
        name: name.to_owned(),
        hash: format!("{:032x}", (chance(&[seed, 5]) * 1e15) as u64),
        triangles,
        notes: Vec::new(),
        rows,
        runs,
        errors: None,
        pictures: pictures(seed),
    };
    scene.set_errors(None);
    scene
}

fn row(
    scene: &str,
    (method, mu, _, _, iterations): Method,
    triangles: u32,
    cost: f64,
    build_s: f64,
    [seed, m]: [u64; 2],
) -> MethodRow {
    let peer = method.starts_with("obvhs");
    let on_host = peer || method.starts_with("sah") || method == "rbvh";
    let overall = 420.0 / cost * (0.9 + 0.2 * chance(&[seed, m, 6]));
    MethodRow {
        scene: scene.to_owned(),
        method: method.to_owned(),
        mu,
        device: if peer {
            "cpu (peer)"
        } else if on_host {
            "cpu (host)"
        } else {
            DEVICE
        }
        .to_owned(),
        threads: if method == "rbvh" {
            1
        } else if on_host {
            2
        } else {
            0
        },
        traced_on: Some(DEVICE.to_owned()),
        cost: Some(cost),
        adaptive_cost: Some(0.83 * cost),
        build_s: Some(build_s),
        device_s: (!on_host).then_some(0.94 * build_s),
        mrays: Some(RayRates { overall, primary: 1.9 * overall, shadow: 1.2 * overall, secondary: 0.7 * overall }),
        box_tests: Some(0.31 * cost),
        triangle_tests: Some(0.021 * cost + 3.0),
        depth: Some(24 + (40.0 * chance(&[seed, m, 7])) as u32),
        stack: Some(22 + (38.0 * chance(&[seed, m, 7])) as u32),
        bound: None,
        epo: Some(0.04 * cost * chance(&[seed, m, 8])),
        epo_error: Some(0.0),
        bytes: (!on_host).then_some(u64::from(triangles) * (100 + 12 * m)),
        references: None,
        iterations: (iterations > 0).then_some(iterations),
        tree_hash: Some(format!("{:032x}", (chance(&[seed, m, 9]) * 1e15) as u64 | 1 << 60)),
        relative_error: None,
        time_to: None,
        status: "ok".to_owned(),
        against_rbvh: mu.map(|mu| AgainstRbvh {
            cost: 1.001 * cost,
            rbvh_s: build_s * 120.0,
            prbvh_s: build_s * 120.0 / (30.0 + f64::from(mu)),
            speed_up: 30.0 + f64::from(mu),
        }),
    }
}

fn run(
    purpose: Purpose,
    (method, initial, mu): (&str, &str, u32),
    [first, last]: [f64; 2],
    seconds: f64,
    iterations: u32,
    [seed, m]: [u64; 2],
) -> OptimizerRun {
    let on_device = !["rbvh", "sah", "obvhs"].iter().any(|host| method.starts_with(host));
    let build_s = if iterations == 0 { seconds } else { 0.02 * seconds.min(30.0) };
    let row = |iteration: u32| {
        let t = f64::from(iteration) / f64::from(iterations.max(1));
        let left = if iterations == 0 { 0.0 } else { ((-6.0 * t).exp() - (-6.0f64).exp()) / (1.0 - (-6.0f64).exp()) };
        let bump = if iteration % 9 == 8 { 0.002 * first * left } else { 0.0 };
        let found =
            f64::from(60_000 / mu.max(1)) * (0.4 + left) * (0.8 + 0.4 * chance(&[seed, m, u64::from(iteration)]));
        IterationRow::default().with(|row| {
            row.iteration = iteration;
            row.mu = (f64::from(mu) * (1.0 - t)).ceil().max(1.0) as u32;
            row.time_s = (seconds - build_s) * if iterations == 0 { 0.0 } else { t };
            row.device_s = (seconds - build_s) * 0.95 * if iterations == 0 || !on_device { 0.0 } else { t };
            row.cost = last + (first - last) * left + bump;
            row.searched = if iteration == 0 { 0 } else { 2 * found as u32 };
            row.visits = if iteration == 0 { 0 } else { 90 * found as u32 };
            row.found = if iteration == 0 { 0 } else { found as u32 };
            row.owned = if iteration == 0 { 0 } else { (0.7 * found) as u32 };
            // None in the last one.
            row.applied = if iteration == 0 || iteration == iterations { 0 } else { (0.55 * found) as u32 };
            row.most_steps = 900 + iteration;
        })
    };
    let kinds = if !on_device {
        &PHASES[..0]
    } else if iterations == 0 {
        &PHASES[6..12]
    } else {
        &PHASES[..]
    };
    let weights: Vec<f64> =
        (0..kinds.len()).map(|k| chance(&[seed, m, k as u64, 10]) / (1.0 + (k * k) as f64)).collect();
    let total: f64 = weights.iter().sum();
    let phase = |(k, label): (usize, &&str)| Phase {
        label: (*label).to_owned(),
        seconds: 0.9 * seconds * weights[k] / total,
        calls: u64::from(iterations.max(1)),
        share: weights[k] / total,
    };
    OptimizerRun {
        method: method.to_owned(),
        purpose,
        initial: initial.to_owned(),
        strategy: if mu > 0 { "aggressive" } else { "" }.to_owned(),
        mu,
        device: if on_device { DEVICE } else { "cpu" }.to_owned(),
        build_s,
        build_device_s: on_device.then_some(0.9 * build_s),
        rows: (0..=iterations).map(row).collect(),
        phases: kinds.iter().enumerate().map(phase).collect(),
        plan: if on_device { plan_lines(iterations > 0) } else { Vec::new() },
    }
}

fn plan_lines(is_optimised: bool) -> Vec<String> {
    let leaves = "collapse to adaptive leaves: one triangle per leaf was asked for (25.7 MiB, 3 dispatches)";
    let other = if is_optimised {
        "refits of nodes below which nothing moved: only nodes above a move are refitted"
    } else {
        "kernels of the optimiser and its buffers: the optimiser is <none> & \"nothing\""
    };
    vec![leaves.to_owned(), other.to_owned()]
}

fn pictures(seed: u64) -> Vec<Picture> {
    let titles = ["view 1, shaded", "view 1, tests per pixel, lbvh", "view 1, tests per pixel, prbvh µ = 9"];
    titles.iter().zip(0..).map(|(title, k)| picture(title, seed, k)).collect()
}

fn picture(title: &str, seed: u64, k: u64) -> Picture {
    let (width, height) = (320u32, 180u32);
    let pixel = |i: u32| {
        let (x, y) = (f64::from(i % width) / f64::from(width), f64::from(i / width) / f64::from(height));
        let wave = (9.0 * x + seed as f64).sin() * (7.0 * y + k as f64).cos();
        let heat = 1.5 + 1.4 * wave;
        let channel =
            |c: f64| ((if k == 0 { 0.5 + 0.4 * wave - 0.1 * c } else { heat - c }).clamp(0.0, 1.0) * 255.0) as u8;
        [0.0, 1.0, 2.0].map(channel)
    };
    let pixels: Vec<u8> = (0..width * height).flat_map(pixel).collect();
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.write_header().unwrap().write_image_data(&pixels).unwrap();
    Picture { title: title.to_owned(), width, height, png }
}

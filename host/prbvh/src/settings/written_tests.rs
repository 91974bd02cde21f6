//! Settings as JSON.

use super::{Initial, Optimizer, Settings};
use crate::build::{Bins, TreeletSize};
use crate::collapse::CollapseSettings;
use crate::optimize::{Epsilon, Limits, PrbvhSettings, RbvhSettings, RotationSettings};
use crate::presplit::PresplitSettings;
use serde_json::{Value, json};
use std::num::NonZeroU32;
use std::time::Duration;

fn written(settings: &Settings) -> Value {
    let value = serde_json::to_value(settings).unwrap();
    assert_eq!(serde_json::from_value::<Settings>(value.clone()).unwrap(), *settings, "{value}");
    value
}

fn with_initial(initial: Initial) -> Value {
    written(&Settings::default().with(|settings| settings.initial = initial))
}

#[test]
fn settings_are_plain_keys_and_read_back() {
    let plain = written(&Settings::default());
    for (key, value) in [
        ("initial", json!("lbvh")),
        ("morton_bits", json!("60")),
        ("optimizer", json!("prbvh")),
        ("order", json!("worst-first")),
        ("strategy", json!("aggressive")),
        ("mu", json!(9)),
        ("epsilon", json!(1e-4)),
        ("epsilon_relative", json!(true)),
        ("max_iterations", json!(1000)),
        ("max_time_s", Value::Null),
        ("target_cost", Value::Null),
        ("fold_duplicates", json!(false)),
        ("max_depth", json!(63)),
        ("adaptive", Value::Null),
        ("wide", Value::Null),
        ("presplit", Value::Null),
    ] {
        assert_eq!(plain[key], value, "{key}");
    }
    assert!(plain["worst_first"]["first"] == 8 && plain.get("rbvh").is_none() && plain.get("radius").is_none());
}

#[test]
fn what_is_chosen_brings_its_keys() {
    let ploc = with_initial(Initial::Ploc { radius: NonZeroU32::new(7).unwrap() });
    assert_eq!((&ploc["initial"], &ploc["radius"]), (&json!("ploc"), &json!(7)));
    let atrbvh = with_initial(Initial::Atrbvh { treelet: TreeletSize::new(5).unwrap() });
    assert_eq!((&atrbvh["initial"], &atrbvh["treelet"]), (&json!("atrbvh"), &json!(5)));
    let trbvh = with_initial(Initial::Trbvh { passes: NonZeroU32::new(5).unwrap() });
    assert_eq!((&trbvh["initial"], &trbvh["passes"]), (&json!("trbvh"), &json!(5)));
    let hploc = with_initial(Initial::Hploc { radius: NonZeroU32::new(7).unwrap() });
    assert_eq!((&hploc["initial"], &hploc["radius"]), (&json!("hploc"), &json!(7)));
    let binned = with_initial(Initial::SahBinned { bins: Bins::MIN });
    assert_eq!((&binned["initial"], &binned["bins"]), (&json!("sah-binned"), &json!(8)));
    let rotations = written(&Settings::default().with(|settings| {
        settings.optimizer = Optimizer::Rotations(RotationSettings::default().with(|s| s.annealing_passes = 3));
    }));
    assert_eq!(
        (&rotations["optimizer"], &rotations["rotations"]["annealing_passes"]),
        (&json!("rotations"), &json!(3))
    );
    assert!(rotations["rotations"]["max_iterations"] == 1000 && rotations.get("rbvh").is_none());
    let file = with_initial(Initial::File { path: "a/tree.bvh".into() });
    assert_eq!((&file["initial"], &file["path"]), (&json!("file"), &json!("a/tree.bvh")));
    for (name, settings) in [
        ("aac", json!({ "delta": 4, "epsilon": 0.2 })),
        ("kmeans", json!({ "k": 16, "p": 5, "i": 5, "seed": 1 })),
        ("insertion", json!({ "most_steps": 1024, "seed": 1 })),
        ("online", json!({ "batch": 0.25, "worst": 0.05, "most_steps": 1024, "seed": 1 })),
        ("hunt", json!({ "cut": 500 })),
        ("phr", json!({ "alpha": 0.55, "delta": 9.0 })),
    ] {
        let text = if name == "aac" { "aac:fast" } else { name };
        let built = with_initial(Initial::of_name(text).unwrap().unwrap());
        assert_eq!((&built["initial"], &built[name]), (&json!(name), &settings));
    }
    let presplit = written(&Settings::default().with(|settings| settings.presplit = Some(PresplitSettings::default())));
    assert_eq!(presplit["presplit"], json!({ "budget": 0.3, "form": "level" }));
    let sbvh = with_initial(Initial::Sbvh);
    assert_eq!((&sbvh["initial"], &sbvh["sbvh"]["bins"]), (&json!("sbvh"), &json!(32)));
    let limits = Limits::iterations(3).with(|limits| limits.max_time = Some(Duration::from_millis(1500)));
    let rbvh = written(&Settings::default().with(|settings| {
        settings.optimizer = Optimizer::Rbvh(RbvhSettings::default().with(|rbvh| rbvh.limits = limits));
        settings.adaptive = Some(CollapseSettings::default());
        settings.prbvh = PrbvhSettings::published().with(|prbvh| prbvh.epsilon = Epsilon::Absolute(0.1));
    }));
    assert_eq!((&rbvh["optimizer"], &rbvh["rbvh"]["max_time_s"]), (&json!("rbvh"), &json!(1.5)));
    assert_eq!((&rbvh["epsilon"], &rbvh["epsilon_relative"]), (&json!(0.1), &json!(false)));
    assert_eq!(rbvh["adaptive"]["sah"]["c_traversal"], 3.0);
}

#[test]
fn what_no_setting_can_be_is_refused_on_the_way_in() {
    let with = |key: &str, value: Value| {
        let mut settings = written(&Settings::default());
        settings[key] = value;
        serde_json::from_value::<Settings>(settings).map_err(|error| error.to_string())
    };
    assert!(with("initial", json!("magic")).unwrap_err().contains("magic"));
    assert!(with("max_time_s", json!(-1.0)).unwrap_err().contains("negative"));
    assert!(with("mu", json!("nine")).unwrap_err().contains("nine"));
    assert!(with("mu", json!(4)).is_ok());
    let atrbvh = json!({ "initial": "atrbvh", "treelet": 99, "optimizer": "none", "epsilon": 0.1, "epsilon_relative": true, "max_iterations": 1 });
    assert!(serde_json::from_value::<Settings>(atrbvh).unwrap_err().to_string().contains("4 to 32"));
}

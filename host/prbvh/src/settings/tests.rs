//! Each setting is told by its name.

use super::*;
use crate::build::TreeletSize;
use crate::bvh::SahModel;
use crate::optimize::Epsilon;

#[test]
fn a_method_that_is_left_out_says_so() {
    let initial = Initial::Atrbvh { treelet: TreeletSize::default() };
    assert_eq!(initial.to_string(), "atrbvh");
    assert_eq!(initial.check().is_ok(), cfg!(feature = "atrbvh"));
    let trbvh = Initial::Trbvh { passes: crate::build::DEFAULT_PASSES };
    assert_eq!((trbvh.to_string(), trbvh.check().is_ok()), ("trbvh".to_owned(), cfg!(feature = "atrbvh")));
    let error = FeatureOff { method: "atrbvh", feature: "atrbvh" }.to_string();
    assert!(error.contains("without the cargo feature `atrbvh`"), "{error}");
}

#[test]
fn what_is_usual_is_good() {
    PrbvhSettings::default().check().unwrap();
    PrbvhSettings::published().check().unwrap();
    RbvhSettings::default().check().unwrap();
    RotationSettings::default().check().unwrap();
    CollapseSettings::default().check().unwrap();
    Limits::iterations(0).check().unwrap();
}

#[test]
fn a_builder_whose_parameters_make_no_sense_is_refused() {
    let hunt = HuntSettings { cut: 0 };
    let settings = Settings::default().with(|settings| settings.initial = Initial::Hunt { hunt });
    assert_eq!(settings.check().unwrap_err().to_string(), "hunt.cut is 0, but must be 2 to 65536");
}

#[test]
fn each_bad_value_is_told_with_its_field() {
    let prbvh = |change: &dyn Fn(&mut PrbvhSettings)| {
        let mut settings = PrbvhSettings::default();
        change(&mut settings);
        settings.check()
    };
    let rbvh = |change: &dyn Fn(&mut RbvhSettings)| {
        let mut settings = RbvhSettings::default();
        change(&mut settings);
        settings.check()
    };
    let rotations = |change: &dyn Fn(&mut RotationSettings)| {
        let mut settings = RotationSettings::default();
        change(&mut settings);
        settings.check()
    };
    let leaves = |c_traversal, max_leaf| {
        CollapseSettings { sah: SahModel { c_traversal, ..SahModel::default() }, max_leaf }.check()
    };
    let cases = [
        ("mu", "0", prbvh(&|s| s.mu = 0)),
        ("epsilon", "NaN", prbvh(&|s| s.epsilon = Epsilon::Relative(f64::NAN))),
        ("epsilon", "-0.1", prbvh(&|s| s.epsilon = Epsilon::Absolute(-0.1))),
        ("patience", "0", prbvh(&|s| s.patience = 0)),
        ("target_cost", "NaN", prbvh(&|s| s.limits.target_cost = Some(f64::NAN))),
        ("worst_first.first", "0", prbvh(&|s| s.worst_first.first = 0)),
        ("worst_first.growth", "NaN", prbvh(&|s| s.worst_first.growth = f64::NAN)),
        ("worst_first.growth", "0.9", prbvh(&|s| s.worst_first.growth = 0.9)),
        ("worst_first.growth", "inf", prbvh(&|s| s.worst_first.growth = f64::INFINITY)),
        ("worst_first.most_part", "0", prbvh(&|s| s.worst_first.most_part = 0.0)),
        ("worst_first.most_part", "NaN", prbvh(&|s| s.worst_first.most_part = f64::NAN)),
        ("worst_first.lock_rounds", "0", prbvh(&|s| s.worst_first.lock_rounds = 0)),
        ("worst_first.lock_rounds", "4294967295", prbvh(&|s| s.worst_first.lock_rounds = u32::MAX)),
        ("worst_first.slack", "NaN", prbvh(&|s| s.worst_first.slack = f32::NAN)),
        ("worst_first.settles", "1", prbvh(&|s| s.worst_first.settles = 1.0)),
        ("worst_first.patience", "0", prbvh(&|s| s.worst_first.patience = 0)),
        ("worst_first.tail_part", "1.1", prbvh(&|s| s.worst_first.tail_part = 1.1)),
        ("batch", "0", rbvh(&|s| s.batch = 0.0)),
        ("batch", "NaN", rbvh(&|s| s.batch = f64::NAN)),
        ("epsilon", "-1", rbvh(&|s| s.epsilon = -1.0)),
        ("patience", "0", rbvh(&|s| s.patience = 0)),
        ("target_cost", "NaN", rbvh(&|s| s.limits.target_cost = Some(f64::NAN))),
        ("temperature", "-1", rotations(&|s| s.temperature = -1.0)),
        ("epsilon", "NaN", rotations(&|s| s.epsilon = f64::NAN)),
        ("c_traversal", "-1", leaves(-1.0, None)),
        ("c_traversal", "NaN", leaves(f64::NAN, None)),
        ("max_leaf", "0", leaves(1.0, Some(0))),
    ];
    for (name, value, checked) in cases {
        let error = checked.expect_err(name);
        assert_eq!((error.name, &*error.value), (name, value));
        assert!(error.to_string().starts_with(&format!("{name} is {value}, but must be ")), "{error}");
    }
}

//! The table of rules: a rule is a file here and a line there.

use super::{Entry, Rule};

macro_rules! rules {
    ($($file:ident)*) => {
        $(mod $file;)*
        /// All rules, by code.
        pub static RULES: &[Entry] =
            &[$(Entry { rule: &$file::RULE, source: include_str!(concat!(stringify!($file), ".rs")) }),*];
    };
}

/// What levels find: an `allow` that silences nothing.
pub(super) static UNUSED_ALLOW: &Rule = &w1000_unused_allow::RULE;

rules! {
    w1000_unused_allow
    w1001_unused_point
    w1002_unused_let
    w1003_unused_param
    w1004_unused_ground
    w1005_unused_item
    w1006_unused_trace
    w1007_unused_target
    w1008_unused_output
    w1009_similar_names
    w1010_suspicious_length
    w1012_start_at_bound
    w1014_wide_bounds
    w1015_same_points
    w1016_short_body
    w1017_same_bodies
    w1019_requirement_always_holds
    w1020_requirement_cannot_hold
    w1021_requirement_above_strength
    w1022_weaker_requirement
    w1023_repeated_term
    w1024_uneven_terms
    w1026_still_drive
    w1027_rest_outside
    w1028_zero_weight
    w1029_free_without_goal
    w1030_goal_without_free
    w1031_no_requirement
    w1033_no_edition
    w1034_mixed_scales
    w1101_overconstrained
    w1103_poor_transmission
    w1104_fast_joint
    w1105_loop_nearly_opens
    w1106_wide_turn
    w1107_better_rest
    w1108_links_cross_at_rest
    w1109_links_cross_on_the_way
    w1111_servo_range
    w1113_still_trace
    w1114_coarse_cycle
    w1201_thinner_than_process
    w1202_bounds_below_process
    w1203_leaves_too_close
    w1204_strain_beyond_once
    w1205_strain_beyond_repeated
    w1206_stubby_flexure
    w1207_slender_flexure
    w1208_turned_section
    w1209_bends_across_layers
    w1210_buckles
    w1211_reaches_past_joint
    w1212_large_fillet
    w1213_small_fillet
    w1301_stress_near_strength
    w1302_torque_near_stall
    w1303_strain_repeated
    w1304_strain_once
    w1305_gives_way
    w1307_larger_than_bed
    w1308_overhang
    w1309_rests_on_bound
    w1311_far_off_target
    w1312_gap_near_clearance
}

//! CSV files, with the column names of various programs.

use limpid::liquid::Particles;

use super::bgeo::bgeo;
use super::{all_attributes, check_left_out, check_message, positions_only, read};

pub(crate) const CSV: &str = "id,x,y,z,vx,vy,vz,density,other,radius
7,0.5,-1.25,2,1,0,-9.5,1000,a,0.025
-1,3.5,4,-5.75,0.25,0.5,0.75,998.5,\"b, c\",0

123456789,0,1e-3,1e6,-0,2,3,1001.25,,0.5
";

#[test]
fn csv_variants() {
    assert_eq!(read("a.csv", CSV.as_bytes()).unwrap(), all_attributes());
    let marked = [b"\xef\xbb\xbf", CSV.replace('\n', "\r\n").as_bytes()].concat();
    assert_eq!(read("a.csv", &marked).unwrap(), all_attributes());
    let quoted = CSV.replace("b, c", "b");
    assert_eq!(read("a.csv", quoted.replace(',', ";").as_bytes()).unwrap(), all_attributes());
    assert_eq!(read("a.CSV", quoted.replace(',', "\t").as_bytes()).unwrap(), all_attributes());
    let renamed = |x: [&str; 3], v: [&str; 3]| {
        let header = format!("id,{},{},density,other,radius", x.join(","), v.join(","));
        CSV.replacen(CSV.lines().next().unwrap(), &header, 1)
    };
    for (x, v) in [
        (["px", "py", "pz"], ["velocity_x", "velocity_y", "velocity_z"]),
        (
            ["\"Points:0\"", "\"Points:1\"", "\"Points:2\""],
            ["velocity:0", "velocity:1", "velocity:2"],
        ),
        (["Points_0", "Points_1", "Points_2"], ["Velocity_0", "Velocity_1", "Velocity_2"]),
        (["Pos.x [m]", "Pos.y [m]", "Pos.z [m]"], ["Vel.x [m/s]", "Vel.y [m/s]", "Vel.z [m/s]"]),
    ] {
        assert_eq!(read("a.csv", renamed(x, v).as_bytes()).unwrap(), all_attributes(), "{x:?}");
    }
    let bare = "0.5,-1.25,2,9\n3.5, 4 ,-5.75,9\n# a comment\n0,1e-3,1e6,9";
    assert_eq!(read("a.csv", bare.as_bytes()).unwrap(), positions_only());
    assert_eq!(read("a.csv", b"").unwrap(), Particles::default());
    assert_eq!(read("a.csv", b"x,y,z\n").unwrap(), Particles::default());
    let large = "x,y,z,id\n0,0,0,9007199254740993\n0,0,0,-3.0\n";
    let ids = read("a.csv", large.as_bytes()).unwrap().ids;
    assert_eq!(ids, Some(vec![9_007_199_254_740_993, -3]));
}

#[test]
fn csv_malformed() {
    let check = |from: &str, to: &str, fragments: &[&str]| {
        assert!(CSV.contains(from), "{from}");
        check_message("a.csv", CSV.replacen(from, to, 1).as_bytes(), fragments);
    };
    check("3.5,4", "3.5,w", &["line 3", "particle 1", "position", "`w`"]);
    check_left_out("a.csv", CSV.replacen("0,1e-3", "0,nan", 1).as_bytes(), 2);
    check("1000,a,0.025", "1000", &["line 2", "particle 0", "radius", "no such column"]);
    check("x,y,z", "a,b,c", &["no columns x, y and z", "id, a, b, c"]);
    check_message("a.csv", b"1,2\n3,4\n", &["line 1", "position", "no such column"]);
    check_message("a.csv", &bgeo(), &["a BGEO file"]);
}

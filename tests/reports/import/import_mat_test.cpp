// metastable import: the same experiment told in MAT files, and files that are cut short or damaged.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "analysis/experiment/experiment.h"
#include "reports/import/mat_rows.h"
#include "tests/reports/import/importing.h"
#ifdef METASTABLE_MATIO
#include <hdf5.h>
#include <matio.h>
#endif

namespace metastable::reports::test {
namespace {

#ifdef METASTABLE_MATIO

class ImportMat : public Import {
 protected:
  using Pad = std::vector<std::vector<double>>;

  // Returns the speeds of each trial, in deg/s.
  static std::vector<double> speeds(const MeasuredTrial& trial) {
    std::vector<double> values;
    for (const MeasuredCollision& c : trial.collisions) values.push_back(c.omega_minus * 180 / std::numbers::pi);
    return values;
  }
  static matvar_t* array(const char* name, std::vector<double> values, std::size_t rows, std::size_t columns) {
    std::size_t dims[] = {rows, columns};
    return Mat_VarCreate(name, MAT_C_DOUBLE, MAT_T_DOUBLE, 2, dims, values.data(), 0);
  }
  static matvar_t* text(const char* name, std::string value) {
    std::size_t dims[] = {1, value.size()};
    return Mat_VarCreate(name, MAT_C_CHAR, MAT_T_UINT8, 2, dims, value.data(), 0);
  }
  std::string save(const std::vector<matvar_t*>& variables) const {
    mat_t* const mat = Mat_CreateVer(path("lab.mat").c_str(), nullptr, MAT_FT_MAT5);
    for (matvar_t* const v : variables) {
      Mat_VarWrite(mat, v, compression_);
      Mat_VarFree(v);
    }
    Mat_Close(mat);
    return path("lab.mat");
  }
  matio_compression compression_ = MAT_COMPRESSION_NONE;
  // Returns each trial's condition, and its number.
  matvar_t* conditions() const {
    std::size_t dims[] = {known_.trials.size(), 1};
    std::vector<matvar_t*> cells;
    for (const MeasuredTrial& trial : known_.trials)
      cells.push_back(text(nullptr, known_.conditions[trial.condition].id));
    return Mat_VarCreate("start", MAT_C_CELL, MAT_T_CELL, 2, dims, cells.data(), 0);
  }
  // Leaves all known but for what these files do not tell.
  void forget() {
    forget_course();
    for (MeasuredTrial& trial : known_.trials) {
      trial.outcome.reset();
      for (MeasuredCollision& c : trial.collisions) c.leg.reset(), c.omega_plus.reset();
    }
  }
  matvar_t* matrix(bool columns) const {
    std::vector<double> values(9, std::nan(""));
    for (std::size_t t = 0; t < 3; ++t)
      for (std::size_t i = 0; i < known_.trials[t].collisions.size(); ++i)
        values[columns ? i + 3 * t : t + 3 * i] = speeds(known_.trials[t])[i];
    return array("w", values, 3, 3);
  }
};

TEST_F(ImportMat, StructArrays) {
  const char* fields[] = {"n", "w", "w_plus", "leg", "start", "outcome"};
  std::size_t dims[] = {1, known_.trials.size()};
  matvar_t* const trials = Mat_VarCreateStruct("trials", 2, dims, fields, 6);
  for (std::size_t t = 0; t < known_.trials.size(); ++t) {
    const MeasuredTrial& trial = known_.trials[t];
    std::vector<double> plus, legs;
    for (const MeasuredCollision& c : trial.collisions) {
      plus.push_back(c.omega_plus ? *c.omega_plus : std::nan(""));
      legs.push_back(*c.leg + 1);
    }
    const std::size_t n = plus.size();
    const auto set = [&](const char* field, matvar_t* value) { Mat_VarSetStructFieldByName(trials, field, t, value); };
    set("n", array(nullptr, {static_cast<double>(trial.number)}, 1, 1));
    set("w", array(nullptr, speeds(trial), n, 1));
    set("w_plus", array(nullptr, plus, 1, n));
    set("leg", array(nullptr, legs, n, 1));
    set("start", text(nullptr, known_.conditions[trial.condition].id));
    set("outcome", text(nullptr, trial.outcome == dynamics::Outcome::rest ? "rest" : "max_collisions"));
  }
  forget_course();
  expect_same(import({save({trials}), "--legs-from", "1", "--columns",
                      "trial=trials.n,condition=trials.start,omega_minus=trials.w[deg/s],"
                      "omega_plus=trials.w_plus[rad/s],leg=trials.leg,outcome=trials.outcome"}),
              1e-15);
}

TEST_F(ImportMat, MatricesPaddedWithNan) {
  forget();
  for (const bool columns : {true, false})
    expect_same(import({save({matrix(columns), conditions(), array("n", {1, 2, 4}, 1, 3)}), "--trials-in",
                        columns ? "columns" : "rows", "--columns", "trial=n,condition=start,omega_minus=w[deg/s]"}),
                1e-15);
  expect_refused(import({path("lab.mat"), "--columns", "trial=n,condition=start,omega_minus=w[deg/s]"}),
                 path("lab.mat") + ": w: is 3 x 3: say --trials-in columns or --trials-in rows");
  expect_refused(
      import({path("lab.mat"), "--trials-in", "columns", "--columns", "trial=n,condition=start,omega_minus=w[deg/s]"}),
      path("lab.mat") + ": w(2,2): NaN before the last number");
}

TEST_F(ImportMat, VectorsAndWhatIsWrongWithThem) {
  forget();
  std::vector<double> all, of_trial;
  for (const MeasuredTrial& trial : known_.trials)
    for (const double speed : speeds(trial)) all.push_back(speed), of_trial.push_back(trial.number);
  const std::vector<double> legs(all.size() - 1, 0.0);
  const std::string mat = save({array("w_deg_s", all, all.size(), 1), array("run", of_trial, 1, all.size()),
                                array("short", legs, legs.size(), 1), text("name", "fast")});
  const auto columns = [&](const std::string& map) { return import({mat, "--columns", map}); };
  const std::string conditions =
      file("one.toml", std::string(known_toml).substr(0, std::string(known_toml).rfind("[[")));
  for (MeasuredTrial& trial : known_.trials) trial.condition = 0;
  EXPECT_EQ(metastable({"import", mat, "--columns", "omega_minus=w_deg_s,trial=run,condition=name", "--description",
                        conditions, "--out", path("out")})
                .code,
            0);
  expect_same({0, "", ""}, 1e-15);
  expect_refused(columns("omega_minus=w[deg/s]"),
                 "--columns: " + mat + " has no 'w' for omega_minus (it has w_deg_s, run, short, name)");
  expect_refused(columns("omega_minus=w_deg_s,trial=run,leg=short"),
                 mat + ": short: has 5 numbers where w_deg_s has 6");
  expect_refused(columns("omega_minus=w_deg_s"),
                 mat +
                     ": w_deg_s: is 6 x 1: say --trials-in columns or --trials-in rows, or map trial to a vector of as "
                     "many");
}

matvar_t* struct_of(const char* name, const char* field, matvar_t* value) {
  std::size_t dims[] = {1, 1};
  const char* fields[] = {field};
  matvar_t* const whole = Mat_VarCreateStruct(name, 2, dims, fields, 1);
  Mat_VarSetStructFieldByName(whole, field, 0, value);
  return whole;
}

TEST_F(ImportMat, StructsInStructsAndVersion4) {
  forget();
  expect_same(import({save({struct_of("lab", "run", struct_of(nullptr, "w", matrix(true))), conditions(),
                            array("n", {1, 2, 4}, 1, 3)}),
                      "--trials-in", "columns", "--columns", "trial=n,condition=start,omega_minus=lab.run.w[deg/s]"}),
              1e-15);
  expect_refused(import({path("lab.mat"), "--columns", "trial=n,condition=start,omega_minus=lab.run[deg/s]"}),
                 path("lab.mat") + ": lab.run: is a struct (1 x 1) with the fields w; name one of them");
  mat_t* const mat = Mat_CreateVer(path("v4.mat").c_str(), nullptr, MAT_FT_MAT4);
  for (matvar_t* const v : {matrix(true), array("n", {1, 2, 4}, 1, 3)}) {
    Mat_VarWrite(mat, v, MAT_COMPRESSION_NONE);
    Mat_VarFree(v);
  }
  Mat_Close(mat);
  for (MeasuredTrial& trial : known_.trials) trial.condition = 0;
  const std::string one = file("one.toml", std::string(known_toml).substr(0, std::string(known_toml).rfind("[[")));
  expect_same(metastable({"import", path("v4.mat"), "--trials-in", "columns", "--columns",
                          "trial=n,omega_minus=w[deg/s]", "--description", one, "--out", path("out")}),
              1e-15);
}

// HDF5 as other programs write it, without MATLAB's header and attributes, which brought libmatio down; and the same
// file cut short or spoilt, byte by byte.
TEST_F(ImportMat, Hdf5OfOtherPrograms) {
  forget();
  for (MeasuredTrial& trial : known_.trials) trial.condition = 0;
  const std::string one = file("one.toml", std::string(known_toml).substr(0, std::string(known_toml).rfind("[[")));
  const std::string mat = path("other.mat");
  {
    const hid_t to = H5Fcreate(mat.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT),
                group = H5Gcreate2(to, "lab", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    const auto write = [&](const char* name, const std::vector<double>& values, std::vector<hsize_t> sizes) {
      const hid_t space = H5Screate_simple(static_cast<int>(sizes.size()), sizes.data(), nullptr),
                  data = H5Dcreate2(group, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
      H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
      H5Dclose(data), H5Sclose(space);
    };
    std::vector<double> values(9, std::nan(""));
    for (std::size_t t = 0; t < 3; ++t)
      for (std::size_t i = 0; i < known_.trials[t].collisions.size(); ++i)
        values[i + 3 * t] = speeds(known_.trials[t])[i];
    write("w", values, {3, 3});
    write("n", {1, 2, 4}, {3});
    H5Gclose(group), H5Fclose(to);
  }
  const auto run = [&](const std::string& from) {
    std::filesystem::remove_all(folder_ / "out");
    return metastable({"import", from, "--trials-in", "columns", "--columns", "trial=lab.n,omega_minus=lab.w[deg/s]",
                       "--description", one, "--out", path("out")});
  };
  expect_same(run(mat), 1e-15);
  const std::string whole = read(mat);
  for (std::size_t k = 0; k < 60; ++k) {
    std::string spoilt = whole;
    if (k % 3 == 0)
      spoilt.resize(whole.size() * (k + 1) / 61);
    else
      spoilt[(k * 7919) % std::min<std::size_t>(whole.size(), 2400)] ^= static_cast<char>(1 + k * 37 % 255);
    const Ran ran = run(file("spoilt.mat", spoilt));
    EXPECT_TRUE(ran.code == 0 || ran.code == 2) << k << ran.err;
    EXPECT_EQ(ran.code == 2, ran.err.starts_with("metastable: ")) << ran.err;
    EXPECT_EQ(ran.code == 0, std::filesystem::exists(folder_ / "out")) << k;
  }
}

// A file that is cut short or damaged is refused, where libmatio itself would read other numbers from it.
TEST_F(ImportMat, CutShortOrDamagedIsRefused) {
  const auto refusal_of = [&](const std::string& text) {
    const std::string mat = file("broken.mat", text);
    const Ran ran = import({mat, "--columns", "omega_minus=w[deg/s]", "--trials-in", "columns"});
    EXPECT_EQ(ran.code, 2);
    return ran.err.substr(0, ran.err.find(" at byte"));
  };
  const std::string whole = read(save({matrix(true)}));
  const std::string begin = "metastable: " + path("broken.mat");
  EXPECT_EQ(refusal_of("MATLAB 5.0 MAT-file, not really"), begin + ": is cut short: what begins");
  for (const std::size_t size : {whole.size() - 1, whole.size() - 40, std::size_t{140}, std::size_t{131}})
    EXPECT_EQ(refusal_of(whole.substr(0, size)), begin + ": is cut short: what begins") << size;
  compression_ = MAT_COMPRESSION_ZLIB;
  std::string compressed = read(save({matrix(true)}));
  EXPECT_EQ(refusal_of(compressed.substr(0, compressed.size() - 1)), begin + ": is cut short: what begins");
  compressed[compressed.size() - 12] ^= 1;
  EXPECT_EQ(refusal_of(compressed), begin + ": is damaged: its variable");
}

#else

TEST_F(Import, WithoutTheLibrarySaysWhatToInstall) {
  const std::string mat = file("lab.mat", "MATLAB 5.0 MAT-file, Platform: GLNXA64");
  expect_refused(import({mat, "--columns", "omega_minus=w[rad/s]"}),
                 mat +
                     ": this metastable was built without libmatio, which reads MAT files: install libmatio-dev and "
                     "build again (./run install), or save a CSV (writetable, writematrix)");
}

#endif

}  // namespace
}  // namespace metastable::reports::test

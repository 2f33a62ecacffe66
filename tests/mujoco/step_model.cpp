// Steps a model of MuJoCo without rtcf: a reference for rtcf_mujoco/Simulation.
//
//     rtcf_step_model MODEL KEYFRAME PERIOD_S STEPS <COMMANDS >STATES
//
// KEYFRAME is a number, or -1. Standard input has the commands of all actuators for each cycle,
// standard output gets time, positions and velocities after it; all are doubles of this machine.
#include <mujoco/mujoco.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <cstdlib>

int main(int argc, char** argv) {
    if (argc != 5) return 2;
    std::array<char, 1000> error{};
    mjModel* const model = mj_loadXML(argv[1], nullptr, error.data(), error.size());
    if (model == nullptr) {
        std::fprintf(stderr, "rtcf_step_model: %s\n", error.data());
        return 1;
    }
    const int key = static_cast<int>(std::strtol(argv[2], nullptr, 10));
    const int steps = static_cast<int>(std::strtol(argv[4], nullptr, 10));
    mjData* const data = mj_makeData(model);
    if (key >= 0) mj_resetDataKeyframe(model, data, key);
    model->opt.timestep = std::strtod(argv[3], nullptr) / steps;
    const auto commands = static_cast<std::size_t>(model->nu);
    while (std::fread(data->ctrl, sizeof(mjtNum), commands, stdin) == commands) {
        for (int i = 0; i < steps; ++i) mj_step(model, data);
        std::fwrite(&data->time, sizeof(mjtNum), 1, stdout);
        std::fwrite(data->qpos, sizeof(mjtNum), static_cast<std::size_t>(model->nq), stdout);
        std::fwrite(data->qvel, sizeof(mjtNum), static_cast<std::size_t>(model->nv), stdout);
    }
    mj_deleteData(data);
    mj_deleteModel(model);
    return 0;
}

// Plays one note of a program that Faust made: FREQ GAIN HELD_FRAMES FRAMES RATE_HZ; raw floats, frame by frame.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#ifndef FAUSTFLOAT
#define FAUSTFLOAT float
#endif

struct Meta {
    void declare(const char*, const char*) {}
};

struct UI {
    std::map<std::string, FAUSTFLOAT*> zones;
    void openVerticalBox(const char*) {}
    void closeBox() {}
    void declare(FAUSTFLOAT*, const char*, const char*) {}
    void addButton(const char* label, FAUSTFLOAT* zone) { zones[label] = zone; }
    void addNumEntry(const char* label, FAUSTFLOAT* zone, FAUSTFLOAT, FAUSTFLOAT, FAUSTFLOAT, FAUSTFLOAT) {
        zones[label] = zone;
    }
};

struct dsp {};

<<includeIntrinsic>>
<<includeclass>>

int main(int, char** argv) {
    const int held = std::atoi(argv[3]), frames = std::atoi(argv[4]), rate_hz = std::atoi(argv[5]);
    static mydsp program;
    UI ui;
    program.init(rate_hz);
    program.buildUserInterface(&ui);
    *ui.zones.at("freq") = std::atof(argv[1]);
    *ui.zones.at("gain") = std::atof(argv[2]);
    const int channels = program.getNumOutputs();
    std::vector<std::vector<FAUSTFLOAT>> blocks(channels, std::vector<FAUSTFLOAT>(64));
    std::vector<FAUSTFLOAT*> outputs;
    for (auto& block : blocks) outputs.push_back(block.data());
    for (int done = 0; done < frames;) {
        const int until = done < held ? held : frames;
        const int count = std::min(64, until - done);
        *ui.zones.at("gate") = done < held ? 1 : 0;
        program.compute(count, nullptr, outputs.data());
        for (int frame = 0; frame < count; ++frame)
            for (int channel = 0; channel < channels; ++channel)
                std::fwrite(&blocks[channel][frame], sizeof(FAUSTFLOAT), 1, stdout);
        done += count;
    }
}

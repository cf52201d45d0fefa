// Angles by the table of `armcal export calibration.toml --robot my-arm --as table > table.csv`: no armcal is needed.
//     g++ -std=c++17 -o apply_table apply_table.cpp && ./apply_table table.csv shoulder_yaw 20117
#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

using Points = std::vector<std::pair<double, double>>;  // (counts, rad), counts rising

double angle_rad(const Points& points, double counts) {
    auto next = std::upper_bound(points.begin() + 1, points.end() - 1, std::make_pair(counts, 1e9));
    const auto& [c0, a0] = *(next - 1);
    return a0 + (counts - c0) * (next->second - a0) / (next->first - c0);
}

int main(int argc, char** argv) {
    if (argc != 4) return std::cerr << "apply_table TABLE.csv JOINT COUNTS\n", 2;
    std::ifstream file(argv[1]);
    std::map<std::string, Points> table;
    for (std::string line, joint, counts, rad; std::getline(file, line);) {
        std::istringstream cells(line);
        if (line[0] == '#' || line.rfind("joint,", 0) == 0) continue;
        std::getline(cells, joint, ','), std::getline(cells, counts, ','), std::getline(cells, rad, ',');
        table[joint].emplace_back(std::stod(counts), std::stod(rad));
    }
    auto found = table.find(argv[2]);
    if (found == table.end()) return std::cerr << argv[2] << " is not in " << argv[1] << "\n", 2;
    std::sort(found->second.begin(), found->second.end());
    std::cout.precision(12);
    std::cout << angle_rad(found->second, std::atof(argv[3])) << " rad\n";
}

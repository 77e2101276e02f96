// A form of @name@ that fills the lanes of the processor: NGSolve asks an integrator for one cell at a
// time, the form asks the kernel for a block of cells.
class Form : public ngcomp::T_BilinearForm<double, double> {
    using Base = ngcomp::T_BilinearForm<double, double>;
    static constexpr int BLOCK = 32;
    shared_ptr<Page> page;

    // The block of cells from `first` on.
    struct Block {
        std::vector<Element> cells;
        std::vector<Array<int>> numbers;
        std::vector<double> X, u, data, R, K;
        Block() : numbers(BLOCK), X(BLOCK * NODES * DIM), u(BLOCK * U),
                  data(BLOCK * @NAME@_DATA + 1), R(BLOCK * U), K(BLOCK * U * U)
        {
            cells.reserve(BLOCK);
        }
    };

    static Flags Symmetry()
    {
        Flags flags;
        flags.SetFlag("symmetric", bool(@symmetric@));
        return flags;
    }

    void Read(Block &block, int first, int count, const ngla::BaseVector &state, LocalHeap &lh) const
    {
        block.cells.clear();
        for (int i = 0; i < count; ++i) {
            const ElementId id(VOL, first + i);
            auto &numbers = block.numbers[i];
            fespace->GetDofNrs(id, numbers);
            FlatVector<double> values(numbers.Size(), lh);
            state.GetIndirect(numbers, values);
            fespace->TransformVec(id, values, ngcomp::TRANSFORM_SOL);
            block.cells.push_back(
                page->Read(fespace->GetFE(id, lh), ma->GetTrafo(id, lh), &values, lh));
            const Element &e = block.cells.back();
            std::copy_n(e.X, NODES * DIM, &block.X[i * NODES * DIM]);
            std::copy_n(e.u, U, &block.u[i * U]);
            std::copy_n(e.data, @NAME@_DATA, &block.data[i * @NAME@_DATA]);
        }
    }

    void Add(const Block &block, int first, LocalHeap &lh)
    {
        for (int i = 0; i < int(block.cells.size()); ++i) {
            HeapReset reset(lh);
            const ElementId id(VOL, first + i);
            FlatMatrix<double> elmat(U, U, lh);
            page->Scatter(block.cells[i], &block.K[i * U * U], elmat, lh);
            fespace->TransformMat(id, elmat, ngcomp::TRANSFORM_MAT_LEFT_RIGHT);
            AddElementMatrix(block.numbers[i], block.numbers[i], elmat, id, false, lh);
        }
    }

    // False: where the form has more than the page, or the matrix is new, NGSolve assembles.
    bool Fast(bool reallocate) const
    {
        bool everywhere = true;
        for (int k = 0; k < ma->GetNDomains(); ++k)
            everywhere = everywhere && fespace->DefinedOn(VOL, k);
        return everywhere && !reallocate && int(mats.Size()) == ma->GetNLevels()
            && parts.Size() == 1 && preconditioners.Size() == 0 && page->Constant()
            && ngcore::TaskManager::GetNumThreads() == 1;
    }

public:
    Form(shared_ptr<ngcomp::FESpace> space, shared_ptr<Page> of)
        : Base(space, "@name@", Symmetry()), page(of)
    {
        AddIntegrator(of);
    }

    void AssembleLinearization(
        const ngla::BaseVector &state, LocalHeap &lh, bool reallocate) override
    {
        if (!Fast(reallocate))
            return Base::AssembleLinearization(state, lh, reallocate);
        Block block;
        GetMatrix().AsVector() = 0.0;
        const int cells = ma->GetNE(VOL);
        for (int first = 0; first < cells; first += BLOCK) {
            HeapReset reset(lh);
            const int count = std::min(BLOCK, cells - first);
            Read(block, first, count, state, lh);
            @name@_many_tangent(count, block.X.data(), block.u.data(), block.data.data(),
                block.cells[0].p, block.R.data(), block.K.data());
            Add(block, first, lh);
        }
    }
};
